"""The library: every cause the tissue rig's criticism can name, as places where the chain leaves its null."""
