"""Find a tag, align its known pattern, follow it through the images; and draw it, the inverse."""
