"""The RPLIDAR A2: its protocol, the points in its streams, turns of them, and the device on its serial line."""
