//! sRGB, tone curves, luminance.
