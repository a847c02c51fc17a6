/* Many steps of many fish, after step.c and rows.c: arrays (steps, batch, size) in and out. */

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
