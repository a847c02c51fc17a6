/* One step with its tangent, after step.c. */

static void step_jvp(V *s, V *ds, const V *c, const V *dc, const V *p, const V *dp)
{
  V m1[NM], dm1[NM], K[STAGES][NX], dK[STAGES][NX], X[NX], dX[NX], w[NW], dw[NW];
  const double h = DT / SUBSTEPS;
  follow_jvp(s + NX, c, p, ds + NX, dc, dp, m1, dm1);
  for (int sub = 0; sub < SUBSTEPS; ++sub) {
    for (int i = 0; i < STAGES; ++i) {
      for (int k = 0; k < NX; ++k) { X[k] = s[k]; dX[k] = ds[k]; }
      for (int j = 0; j < i; ++j)
        if (A[i][j] != 0.0)
          for (int k = 0; k < NX; ++k) {
            X[k] += SET1(h * A[i][j]) * K[j][k];
            dX[k] += SET1(h * A[i][j]) * dK[j][k];
          }
      drive_at(s + NX, m1, (sub + C[i]) / SUBSTEPS, w);
      drive_at(ds + NX, dm1, (sub + C[i]) / SUBSTEPS, dw);
      rate_jvp(X, w, p, dX, dw, dp, K[i], dK[i]);
    }
    for (int i = 0; i < STAGES; ++i)
      if (B[i] != 0.0)
        for (int k = 0; k < NX; ++k) {
          s[k] += SET1(h * B[i]) * K[i][k];
          ds[k] += SET1(h * B[i]) * dK[i][k];
        }
  }
  for (int k = 0; k < NM; ++k) { s[NX + k] = m1[k]; ds[NX + k] = dm1[k]; }
}

