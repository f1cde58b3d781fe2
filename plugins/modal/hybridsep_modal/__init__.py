"""Modal tests: the physics model of an axis from a frequency response, a swept sine or Klipper's accelerometer."""
