/* The same with tangents, after tangent.c and rows.c. */

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
