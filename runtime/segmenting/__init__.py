"""From frames to segments: nothing held, a grasp from beginning to end, nothing held again."""
