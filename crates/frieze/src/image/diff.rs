//! Two pictures compared: max, RMSE, PSNR, FLIP.
