"""Belt and screw drives, two masses in a cascaded position loop: the second generator of random drives."""
