"""Position-based dynamics with small steps, as games do it: `adapter.py` is the engine, `loop.py` its one loop."""
