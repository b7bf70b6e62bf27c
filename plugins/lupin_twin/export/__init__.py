"""What a mission has recorded, in the formats that others read."""
