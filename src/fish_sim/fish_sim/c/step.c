/* Explicit Runge-Kutta steps of the fish for many fish at once, with tangents and adjoints.

   V is a double (LANES 1) or a SIMD vector of LANES doubles, see vector.h. Before this text stand the functions
   emitted from the CasADi expressions:
     rate(x, w, p, out), rate_jvp(x, w, p, dx, dw, dp, out, dout), rate_vjp(x, w, p, g, gx, gw, gp),
     follow.. likewise on (m, c, p). Sizes NX motion, NM memory, NS = NX + NM, NP parameters; NC = 2; NW = 4.
   Tableau: STAGES, A[i][j], B[i], C[i]. DT period of a command, SUBSTEPS integrator steps in it. */

#define SET1(v) v_constant(v)

/* drive at fraction c of the period: alpha, alpha', rotor speed, rotor acceleration */
static inline void drive_at(const V *m0, const V *m1, double c, V *w)
{
  w[0] = m0[0] + (m1[0] - m0[0]) * SET1(c);
  w[1] = (m1[0] - m0[0]) * SET1(1.0 / DT);
  w[2] = m0[1] + (m1[1] - m0[1]) * SET1(c);
  w[3] = (m1[1] - m0[1]) * SET1(1.0 / DT);
}

static void step(V *s, const V *c, const V *p)
{
  V m1[NM], K[STAGES][NX], X[NX], w[NW];
  const double h = DT / SUBSTEPS;
  follow(s + NX, c, p, m1);
  for (int sub = 0; sub < SUBSTEPS; ++sub) {
    for (int i = 0; i < STAGES; ++i) {
      for (int k = 0; k < NX; ++k) X[k] = s[k];
      for (int j = 0; j < i; ++j)
        if (A[i][j] != 0.0)
          for (int k = 0; k < NX; ++k) X[k] += SET1(h * A[i][j]) * K[j][k];
      drive_at(s + NX, m1, (sub + C[i]) / SUBSTEPS, w);
      rate(X, w, p, K[i]);
    }
    for (int i = 0; i < STAGES; ++i)
      if (B[i] != 0.0)
        for (int k = 0; k < NX; ++k) s[k] += SET1(h * B[i]) * K[i][k];
  }
  for (int k = 0; k < NM; ++k) s[NX + k] = m1[k];
}

