"""How far can you trust a physics engine? Chains of pendulums against an analytic reference."""

__version__ = "0.1.0"
