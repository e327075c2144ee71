"""From frames to segments: nothing held, a grasp from its beginning to its end, nothing held again."""
