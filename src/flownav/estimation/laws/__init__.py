"""What each sensor measures, as a law over named states: its prediction and its Jacobian, a file a sensor."""
