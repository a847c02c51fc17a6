/* the memory alone (servo, motor, their effects) with tangents: m and dm (steps + 1, batch, NM), row 0 given;
   commands (steps, batch or 1, NC) without tangents */
void memory_jvp(long batch, long steps, double *memory, double *d_memory, const double *commands, long commands_batch,
                const double *parameters, long parameters_batch, const double *d_parameters, long d_parameters_batch)
{
  V m[NM], dm[NM], c[NC], dc[NC], p[NP], dp[NP], m1[NM], dm1[NM];
  for (int k = 0; k < NC; ++k) dc[k] = v_constant(0.0);
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
