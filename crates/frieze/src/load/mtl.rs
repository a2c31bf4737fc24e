//! MTL.
