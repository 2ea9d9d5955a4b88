"""Files that tagsway reads and writes: JSON, CSV, TOML and curves, each with a versioned format.

Inside, everything is SI and radians; here, and only here, become millimetres and grams of it what people and other
programs expect. Every file is written whole or not at all.
"""
