"""ATI Net F/T sensors for tissue-rig."""
