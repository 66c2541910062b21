"""What rmw_zenoh and zenoh-bridge-ros2dds put on the wire besides the CDR: names, hashes, attachments, tokens. Pure."""
