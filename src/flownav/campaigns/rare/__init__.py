"""Events so rare that flying at random would never meet them: how probable, and the most likely way there."""
