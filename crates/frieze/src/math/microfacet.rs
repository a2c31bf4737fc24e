//! The GGX distribution, Smith masking, Fresnel, and their sampling.
