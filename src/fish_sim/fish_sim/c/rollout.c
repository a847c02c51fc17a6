/* Many steps of many fish, after step.c, tangent.c and adjoint.c: arrays (steps, batch, size) in and out. */

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
