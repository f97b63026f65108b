"""CAN logs: frames as columns, decoded through databases; what they say of the bus."""
