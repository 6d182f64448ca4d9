"""Error against run time of numerical choices other than J: meshes, the emulated servo, the axis angle."""
