/* One step's adjoint, after step.c. */

/* transpose of drive_at: adds to the adjoints of m0 and m1 */
static inline void drive_adjoint(const V *gw, double c, V *g0, V *g1)
{
  for (int k = 0; k < 2; ++k) {
    g0[k] += gw[2 * k] * SET1(1.0 - c) - gw[2 * k + 1] * SET1(1.0 / DT);
    g1[k] += gw[2 * k] * SET1(c) + gw[2 * k + 1] * SET1(1.0 / DT);
  }
}

/* s: state before the step; g: adjoint of the state after it, on return of the state before; gc, gp are added to */
static void step_vjp(const V *s, V *g, const V *c, V *gc, const V *p, V *gp)
{
  V m1[NM], gm0[NM], gm1[NM], x[SUBSTEPS][STAGES][NX], K[STAGES][NX], now[NX], w[NW];
  V gX[STAGES][NX], gK[NX], gw[NW], gp_part[NP], gm_part[NM], gc_part[NC];
  const double h = DT / SUBSTEPS;
  follow(s + NX, c, p, m1);
  for (int k = 0; k < NX; ++k) now[k] = s[k];
  for (int sub = 0; sub < SUBSTEPS; ++sub) {
    for (int i = 0; i < STAGES; ++i) {
      for (int k = 0; k < NX; ++k) x[sub][i][k] = now[k];
      for (int j = 0; j < i; ++j)
        if (A[i][j] != 0.0)
          for (int k = 0; k < NX; ++k) x[sub][i][k] += SET1(h * A[i][j]) * K[j][k];
      if (sub == SUBSTEPS - 1 && i == STAGES - 1) break; /* the last rate is only needed differentiated */
      drive_at(s + NX, m1, (sub + C[i]) / SUBSTEPS, w);
      rate(x[sub][i], w, p, K[i]);
    }
    for (int i = 0; i < STAGES; ++i)
      if (B[i] != 0.0 && sub < SUBSTEPS - 1)
        for (int k = 0; k < NX; ++k) now[k] += SET1(h * B[i]) * K[i][k];
  }
  for (int k = 0; k < NM; ++k) { gm0[k] = SET1(0.0); gm1[k] = g[NX + k]; }
  for (int sub = SUBSTEPS - 1; sub >= 0; --sub) {
    for (int i = STAGES - 1; i >= 0; --i) {
      for (int k = 0; k < NX; ++k) gK[k] = SET1(h * B[i]) * g[k];
      for (int j = i + 1; j < STAGES; ++j)
        if (A[j][i] != 0.0)
          for (int k = 0; k < NX; ++k) gK[k] += SET1(h * A[j][i]) * gX[j][k];
      drive_at(s + NX, m1, (sub + C[i]) / SUBSTEPS, w);
      rate_vjp(x[sub][i], w, p, gK, gX[i], gw, gp_part);
      drive_adjoint(gw, (sub + C[i]) / SUBSTEPS, gm0, gm1);
      for (int k = 0; k < NP; ++k) gp[k] += gp_part[k];
    }
    for (int i = 0; i < STAGES; ++i)
      for (int k = 0; k < NX; ++k) g[k] += gX[i][k];
  }
  follow_vjp(s + NX, c, p, gm1, gm_part, gc_part, gp_part);
  for (int k = 0; k < NM; ++k) g[NX + k] = gm0[k] + gm_part[k];
  for (int k = 0; k < NC; ++k) gc[k] += gc_part[k];
  for (int k = 0; k < NP; ++k) gp[k] += gp_part[k];
}

