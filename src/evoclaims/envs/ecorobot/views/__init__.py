"""Views of what robots do: pictures, animations, and a page in three dimensions."""
