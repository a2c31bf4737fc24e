//! sin, pow, exp, ... with the same bits on every machine and at every width.
