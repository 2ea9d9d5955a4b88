"""Tables that other programs wrote: recognised by what is in them, not by their names.

text     bytes to text: byte order marks, UTF-16, line ends
grid     text to columns of numbers: separators, decimal commas, headers of any length
units    what a column's name says: quantity, axis, unit
columns  columns to a track: positions, accelerations or an angle
poses    DeepLabCut's tables, which others write as well
movement movement's netCDF files
kinovea  Kinovea's text and its spreadsheet in XML
logs     a controller's own record of the tool or the joints
"""
