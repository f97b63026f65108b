"""What readings and their errors tell: arrays and a SensorArray in, arrays out."""
