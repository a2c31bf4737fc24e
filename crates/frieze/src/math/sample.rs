//! Low-discrepancy sequences and hemispheres.
