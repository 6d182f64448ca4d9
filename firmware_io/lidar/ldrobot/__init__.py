"""LDROBOT LD06, LD19, STL-19P and STL27L, which only send."""
