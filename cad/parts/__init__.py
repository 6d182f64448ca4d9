"""One file per printed or turned part. Lengths are millimetres, frames are the rotation frame."""
