"""Hardware drivers: rotor (Vertiq), rudder servo, IMU (BNO085) and USB camera."""
