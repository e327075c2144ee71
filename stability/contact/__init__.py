"""Grasps that are hard to bring to rest, checks of their rest at 60 digits, and halved steps."""
