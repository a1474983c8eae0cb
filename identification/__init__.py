"""What the wheel feels: soil parameters from load, torque, sinkage, slip and drawbar pull."""
