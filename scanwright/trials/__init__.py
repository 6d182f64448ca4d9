"""Error against run time of the choices that are not J: meshes, the emulated servo, the axis angle."""
