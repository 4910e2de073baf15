"""MAVLink, once for logs and links: messages to measurements and back, the vehicle's clock, frames, signing."""
