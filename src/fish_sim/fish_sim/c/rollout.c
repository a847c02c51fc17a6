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

/* transpose of drive_at: adds to the adjoints of m0 and m1 */
static inline void drive_adjoint(const V *gw, double c, V *g0, V *g1)
{
  for (int k = 0; k < 2; ++k) {
    g0[k] += gw[2 * k] * SET1(1.0 - c) - gw[2 * k + 1] * SET1(1.0 / DT);
    g1[k] += gw[2 * k] * SET1(c) + gw[2 * k + 1] * SET1(1.0 / DT);
  }
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

/* rows of a (batch, size) array into lanes and back; lanes past the end repeat the last row and are not written */
static inline void gather(const double *from, long size, long stride, long first, long batch, V *to)
{
  for (int l = 0; l < LANES; ++l) {
    const double *row = from + stride * (first + l < batch ? first + l : batch - 1);
    for (long k = 0; k < size; ++k) ((double *)to)[k * LANES + l] = row[k];
  }
}

static inline void scatter(const V *from, long size, long first, long batch, double *to)
{
  for (int l = 0; l < LANES && first + l < batch; ++l)
    for (long k = 0; k < size; ++k) to[(first + l) * size + k] = ((const double *)from)[k * LANES + l];
}

/* states: (steps + 1, batch, NS), row 0 given; commands: (steps, batch or 1, NC); p: (batch or 1, NP) */
void rollout(long batch, long steps, double *states, const double *commands, long commands_batch,
                   const double *parameters, long parameters_batch)
{
  V s[NS], c[NC], p[NP];
  for (long b = 0; b < batch; b += LANES) {
    gather(states, NS, NS, b, batch, s);
    gather(parameters, NP, parameters_batch > 1 ? NP : 0, b, batch, p);
    for (long t = 0; t < steps; ++t) {
      gather(commands + t * commands_batch * NC, NC, commands_batch > 1 ? NC : 0, b, batch, c);
      step(s, c, p);
      scatter(s, NS, b, batch, states + (t + 1) * batch * NS);
    }
  }
}

/* tangents laid out like the values; commands and parameters (and their tangents) per batch element or shared */
void rollout_jvp(long batch, long steps, double *states, double *d_states, const double *commands,
                       long commands_batch, const double *d_commands, long d_commands_batch,
                       const double *parameters, long parameters_batch, const double *d_parameters,
                       long d_parameters_batch)
{
  V s[NS], ds[NS], c[NC], dc[NC], p[NP], dp[NP];
  for (long b = 0; b < batch; b += LANES) {
    gather(states, NS, NS, b, batch, s);
    gather(d_states, NS, NS, b, batch, ds);
    gather(parameters, NP, parameters_batch > 1 ? NP : 0, b, batch, p);
    gather(d_parameters, NP, d_parameters_batch > 1 ? NP : 0, b, batch, dp);
    for (long t = 0; t < steps; ++t) {
      gather(commands + t * commands_batch * NC, NC, commands_batch > 1 ? NC : 0, b, batch, c);
      gather(d_commands + t * d_commands_batch * NC, NC, d_commands_batch > 1 ? NC : 0, b, batch, dc);
      step_jvp(s, ds, c, dc, p, dp);
      scatter(s, NS, b, batch, states + (t + 1) * batch * NS);
      scatter(ds, NS, b, batch, d_states + (t + 1) * batch * NS);
    }
  }
}

/* g_states (steps + 1, batch, NS): adjoints of every state; results: g_start (batch, NS),
   g_commands (steps, batch, NC), g_parameters (batch, NP) */
void rollout_vjp(long batch, long steps, const double *states, const double *commands, long commands_batch,
                       const double *parameters, long parameters_batch, const double *g_states, double *g_start,
                       double *g_commands, double *g_parameters)
{
  V s[NS], g[NS], extra[NS], c[NC], gc[NC], p[NP], gp[NP];
  for (long b = 0; b < batch; b += LANES) {
    gather(parameters, NP, parameters_batch > 1 ? NP : 0, b, batch, p);
    gather(g_states + steps * batch * NS, NS, NS, b, batch, g);
    for (int k = 0; k < NP; ++k) gp[k] = SET1(0.0);
    for (long t = steps - 1; t >= 0; --t) {
      gather(states + t * batch * NS, NS, NS, b, batch, s);
      gather(commands + t * commands_batch * NC, NC, commands_batch > 1 ? NC : 0, b, batch, c);
      for (int k = 0; k < NC; ++k) gc[k] = SET1(0.0);
      step_vjp(s, g, c, gc, p, gp);
      gather(g_states + t * batch * NS, NS, NS, b, batch, extra);
      for (int k = 0; k < NS; ++k) g[k] += extra[k];
      scatter(gc, NC, b, batch, g_commands + t * batch * NC);
    }
    scatter(g, NS, b, batch, g_start);
    scatter(gp, NP, b, batch, g_parameters);
  }
}

/* rates of motion at given instants: x (batch, NX), w (batch, NW), p as above, with tangents; into out and d_out */
void rates_jvp(long batch, const double *x, const double *dx, const double *w, const double *dw,
               const double *parameters, long parameters_batch, const double *d_parameters, long d_parameters_batch,
               double *out, double *d_out)
{
  V X[NX], dX[NX], W[NW], dW[NW], p[NP], dp[NP], K[NX], dK[NX];
  for (long b = 0; b < batch; b += LANES) {
    gather(x, NX, NX, b, batch, X);
    gather(dx, NX, NX, b, batch, dX);
    gather(w, NW, NW, b, batch, W);
    gather(dw, NW, NW, b, batch, dW);
    gather(parameters, NP, parameters_batch > 1 ? NP : 0, b, batch, p);
    gather(d_parameters, NP, d_parameters_batch > 1 ? NP : 0, b, batch, dp);
    rate_jvp(X, W, p, dX, dW, dp, K, dK);
    scatter(K, NX, b, batch, out);
    scatter(dK, NX, b, batch, d_out);
  }
}

/* the memory alone (servo, motor, their effects) with tangents: m and dm (steps + 1, batch, NM), row 0 given;
   commands (steps, batch or 1, NC) without tangents */
void memory_jvp(long batch, long steps, double *memory, double *d_memory, const double *commands, long commands_batch,
                const double *parameters, long parameters_batch, const double *d_parameters, long d_parameters_batch)
{
  V m[NM], dm[NM], c[NC], dc[NC], p[NP], dp[NP], m1[NM], dm1[NM];
  for (int k = 0; k < NC; ++k) dc[k] = SET1(0.0);
  for (long b = 0; b < batch; b += LANES) {
    gather(memory, NM, NM, b, batch, m);
    gather(d_memory, NM, NM, b, batch, dm);
    gather(parameters, NP, parameters_batch > 1 ? NP : 0, b, batch, p);
    gather(d_parameters, NP, d_parameters_batch > 1 ? NP : 0, b, batch, dp);
    for (long t = 0; t < steps; ++t) {
      gather(commands + t * commands_batch * NC, NC, commands_batch > 1 ? NC : 0, b, batch, c);
      follow_jvp(m, c, p, dm, dc, dp, m1, dm1);
      for (int k = 0; k < NM; ++k) { m[k] = m1[k]; dm[k] = dm1[k]; }
      scatter(m, NM, b, batch, memory + (t + 1) * batch * NM);
      scatter(dm, NM, b, batch, d_memory + (t + 1) * batch * NM);
    }
  }
}
