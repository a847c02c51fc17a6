/* Adjoints of many steps of many fish, after adjoint.c and rows.c. */

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
