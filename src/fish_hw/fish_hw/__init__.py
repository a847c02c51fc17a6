# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Hardware drivers: rotor (Vertiq), rudder servo, IMU (BNO085) and USB camera."""
