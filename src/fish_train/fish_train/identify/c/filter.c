/* Extended Kalman filter of one trial with forward sensitivities; see filter.py for the model.

   Stands behind fish_sim's kernel text: V, LANES, NX, NM, NS, NP, NC, NW, DT, SUBSTEPS (each thread's `substeps`), step,
   drive_at, rate, rate_jvp_given and _along, follow, follow_jvp.
   N = NX + 6: motion, wrench on the head, biases of gyro and accelerometer. Directions: N - 3 columns of the
   Jacobian (motion, wrench), then K free parameters; each carries NS + 6 numbers (state, wrench, biases). */
#include <stdlib.h>
#include <string.h>

#define N (NX + 6)
#define ND (NS + 6)
#define SERIES 8 /* terms of the matrix exponential: 3e-6 where the fastest mode turns by 1 rad in half a substep */

typedef struct {
  double camera_latency, camera_heading_offset, camera_scale, gyro_scale, imu_misalignment; /* sensors */
  double slope_latency, slope_heading, slope_scale, slope_gyro, slope_misalignment; /* d sensor / d parameter */
  long free_latency, free_heading, free_scale, free_gyro, free_misalignment; /* index of the free parameter or -1 */
  long wrench_at[3];                                                         /* places in p */
  long links, substeps;
  double wrench_decay, wrench_variance[3]; /* per step of 10 ms */
  double gyro, accel, position, heading;   /* standard deviations */
  double gate_imu, gate_camera;            /* squared normalised innovation */
} Settings;

/* a row of a matrix of N columns, padded to whole vectors with zeros */
#define WIDTH ((N + LANES - 1) / LANES)
typedef union { double at[WIDTH * LANES]; V v[WIDTH]; } Row;
/* a column of a matrix of NX rows, likewise */
#define HEIGHT ((NX + LANES - 1) / LANES)
typedef union { double at[HEIGHT * LANES]; V v[HEIGHT]; } Column;

typedef struct {
  Row P[N], F[N];
  double xi[N], memory[NM];
  double *D; /* (K, ND) derivatives of state, wrench and biases */
} Work;

typedef struct {
  double log_likelihood, samples;
  double *gradient, *normal;
} Sums;

/* tangents of state and parameters along the directions first .. first + LANES - 1; `moving`: those of the motion too,
   without them what parameters and wrench do to a given motion */
static void seed(const Settings *c, const Work *f, long K, const double *dp, long first, int moving, V *ds, V *dpv)
{
  for (int k = 0; k < NS; ++k) ds[k] = v_constant(0.0);
  for (int k = 0; k < NP; ++k) dpv[k] = v_constant(0.0);
  for (int l = 0; l < LANES; ++l) {
    const long j = first + l;
    if (j < NX) LANE(ds[j], l) = 1.0;
    else if (j < NX + 3) LANE(dpv[c->wrench_at[j - NX]], l) = 1.0;
    else if (j < NX + 3 + K) {
      const double *D = f->D + (j - NX - 3) * ND, *row = dp + (j - NX - 3) * NP;
      for (int k = moving ? 0 : NX; k < NS; ++k) LANE(ds[k], l) = D[k];
      for (int k = 0; k < NP; ++k) LANE(dpv[k], l) = row[k];
      for (int i = 0; i < 3; ++i) LANE(dpv[c->wrench_at[i]], l) = D[NS + i];
    }
  }
}

/* parameters with the wrench at the current estimate */
static void load_parameters(const Settings *c, const Work *f, const double *p, V *pv)
{
  for (int k = 0; k < NP; ++k) pv[k] = v_constant(p[k]);
  for (int i = 0; i < 3; ++i) pv[c->wrench_at[i]] = v_constant(f->xi[NX + i]);
}

/* rates of a motion at a fraction of the command period, and along the directions first .. last - 1 (directions, NX) */
static void rates(const Settings *c, const Work *f, long K, const double *p, const double *dp, const double *command,
                  const double *motion, double fraction, int moving, long first, long last, double *rate,
                  double *tangent)
{
  V x[NX], m0[NM], ds[NS], pv[NP], dpv[NP], cmd[NC], zero[NC], m1[NM], dm1[NM], w[NW], dw[NW], out[NX], d_out[NX];
  V shared[RATE_JVP_SHARED];
  for (int i = 0; i < NC; ++i) { cmd[i] = v_constant(command[i]); zero[i] = v_constant(0.0); }
  for (int k = 0; k < NX; ++k) x[k] = v_constant(motion[k]);
  for (int k = 0; k < NM; ++k) m0[k] = v_constant(f->memory[k]);
  load_parameters(c, f, p, pv);
  follow(m0, cmd, pv, m1);
  drive_at(m0, m1, fraction, w);
  rate_jvp_given(x, w, pv, out, shared);
  for (int k = 0; k < NX; ++k) rate[k] = LANE(out[k], 0);
  for (; first < last; first += LANES) {
    seed(c, f, K, dp, first, moving, ds, dpv);
    follow_jvp(m0, cmd, pv, ds + NX, zero, dpv, m1, dm1);
    drive_at(ds + NX, dm1, fraction, dw);
    rate_jvp_along(shared, ds, dw, dpv, d_out);
    for (int l = 0; l < LANES && first + l < last; ++l)
      for (int k = 0; k < NX; ++k) tangent[(first + l) * NX + k] = LANE(d_out[k], l);
  }
}

/* y <- exp(A h) y + (integral of exp(A s) over 0 .. h) b: the series; A is stored column by column */
static void flow(const double *A, const V *b, double h, V *y)
{
  V term[NX], next[NX];
  for (int k = 0; k < NX; ++k) term[k] = y[k];
  for (int m = 1; m <= SERIES; ++m) {
    for (int k = 0; k < NX; ++k) {
      V sum = m == 1 ? b[k] : v_constant(0.0);
#pragma GCC unroll 32
      for (int j = 0; j < NX; ++j) sum += v_constant(A[j * NX + k]) * term[j];
      next[k] = v_constant(h / m) * sum;
    }
    for (int k = 0; k < NX; ++k) { term[k] = next[k]; y[k] += next[k]; }
  }
}

/* out = a b for matrices of N rows */
static void multiply(const Row *a, const Row *b, Row *out)
{
  for (int i = 0; i < N; ++i) {
    V sum[WIDTH];
    for (int w = 0; w < WIDTH; ++w) sum[w] = v_constant(0.0);
    for (int k = 0; k < N; ++k)
#pragma GCC unroll 32
      for (int w = 0; w < WIDTH; ++w) sum[w] += v_constant(a[i].at[k]) * b[k].v[w];
    for (int w = 0; w < WIDTH; ++w) out[i].v[w] = sum[w];
  }
}

/* P <- F P F^T, exactly symmetric */
static void spread(Work *f)
{
  Row T[N], Ft[N];
  for (int i = 0; i < N; ++i) {
    for (int w = 0; w < WIDTH; ++w) Ft[i].v[w] = v_constant(0.0);
    for (int j = 0; j < N; ++j) Ft[i].at[j] = f->F[j].at[i];
  }
  multiply(f->F, f->P, T);
  multiply(T, Ft, f->P);
  for (int i = 0; i < N; ++i)
    for (int j = 0; j < i; ++j) f->P[j].at[i] = f->P[i].at[j];
}

/* motion at a fraction of the period that led from x0 to x1 with these rates at its ends: Hermite's cubic */
static void between(const V *x0, const V *x1, const V *rate0, const V *rate1, double c, double *motion)
{
  for (int k = 0; k < NX; ++k) {
    const double a = LANE(x0[k], 0), b = LANE(x1[k], 0), va = DT * LANE(rate0[k], 0), vb = DT * LANE(rate1[k], 0);
    motion[k] = a + (b - a) * c * c * (3.0 - 2.0 * c) + c * (1.0 - c) * ((1.0 - c) * va - c * vb);
  }
}

/* out += M in, M column by column */
static void add_product(const Column *M, const double *in, Column *out)
{
  Column sum = *out;
#pragma GCC unroll 32
  for (int j = 0; j < NX; ++j)
    for (int w = 0; w < HEIGHT; ++w) sum.v[w] += v_constant(in[j]) * M[j].v[w];
  *out = sum;
}

/* half a step of x' = A x + b is x <- E x + G b: G the integral of exp(A s) over it, E = exp(A h) = 1 + A G */
static void half_step(const double *A, Column *E, Column *G)
{
  Column padded[NX];
  memset(padded, 0, sizeof padded);
  memset(E, 0, NX * sizeof *E);
  memset(G, 0, NX * sizeof *G);
  for (int j = 0; j < NX; ++j) memcpy(padded[j].at, A + j * NX, NX * sizeof(double));
  for (int first = 0; first < NX; first += LANES) {
    V unit[NX], g[NX];
    for (int k = 0; k < NX; ++k) {
      unit[k] = g[k] = v_constant(0.0);
      if (k >= first && k < first + LANES) LANE(unit[k], k - first) = 1.0;
    }
    for (int sub = 0; sub < SUBSTEPS; ++sub) flow(A, unit, 0.5 * DT / SUBSTEPS, g);
    for (int l = 0; l < LANES && first + l < NX; ++l)
      for (int k = 0; k < NX; ++k) G[first + l].at[k] = LANE(g[k], l);
  }
  for (int j = 0; j < NX; ++j) {
    E[j].at[j] = 1.0;
    add_product(padded, G[j].at, &E[j]);
  }
}

/* One step of 10 ms: estimate, covariance, derivatives. The estimate takes the simulator's step. Its tangents follow
   x' = A x + b, the Jacobian A taken in the middle of the step and the parameters' b in the middle of each half, instead of
   the integrator's stages. Against these: 0.1 nats in 90,000, standard errors to 2 %, at half the time. */
static void predict(const Settings *c, Work *f, long K, const double *p, const double *dp, const double *command)
{
  V s0[NS], s1[NS], rate0[NX], rate1[NX], w[NW], pv[NP], cmd[NC], zero[NC], m1[NM], dm1[NM], ds[NS], dpv[NP];
  double at[NX], unused[NX], A[(NX + 3) * NX];
  Column E[NX], G[NX];
  const long columns = NX + 3, last = columns + K;
  double *own = malloc(sizeof(double) * (last + 1) * NX);
  for (int i = 0; i < NC; ++i) { cmd[i] = v_constant(command[i]); zero[i] = v_constant(0.0); }
  load_parameters(c, f, p, pv);
  for (int k = 0; k < NX; ++k) s0[k] = s1[k] = v_constant(f->xi[k]);
  for (int k = 0; k < NM; ++k) s0[NX + k] = s1[NX + k] = v_constant(f->memory[k]);
  step(s1, cmd, pv);
  drive_at(s0 + NX, s1 + NX, 0.0, w);
  rate(s0, w, pv, rate0);
  drive_at(s0 + NX, s1 + NX, 1.0, w);
  rate(s1, w, pv, rate1);

  between(s0, s1, rate0, rate1, 0.5, at);
  rates(c, f, K, p, dp, command, at, 0.5, 0, 0, columns, unused, A);
  half_step(A, E, G);
  memset(f->F, 0, sizeof f->F);
  for (long j = 0; j < columns; ++j) { /* two halves: E E for the motion, E G b + G b for the wrench's own rates b */
    Column one = {{0}}, two = {{0}};
    if (j < NX) one = E[j];
    else {
      add_product(G, A + j * NX, &one);
      two = one;
    }
    add_product(E, one.at, &two);
    for (int k = 0; k < NX; ++k) f->F[k].at[j] = two.at[k];
  }
  for (int half = 0; K && half < 2; ++half) {
    const double fraction = 0.25 + 0.5 * half;
    between(s0, s1, rate0, rate1, fraction, at);
    rates(c, f, K, p, dp, command, at, fraction, 0, columns, last, unused, own);
    for (long j = 0; j < K; ++j) {
      Column next = {{0}};
      add_product(E, f->D + j * ND, &next);
      add_product(G, own + (columns + j) * NX, &next);
      memcpy(f->D + j * ND, next.at, NX * sizeof(double));
    }
  }
  for (long first = 0; first < K; first += LANES) {
    seed(c, f, K, dp, columns + first, 1, ds, dpv);
    follow_jvp(s0 + NX, cmd, pv, ds + NX, zero, dpv, m1, dm1);
    for (int l = 0; l < LANES && first + l < K; ++l) {
      double *D = f->D + (first + l) * ND;
      for (int k = 0; k < NM; ++k) D[NX + k] = LANE(dm1[k], l);
      for (int i = 0; i < 3; ++i) D[NS + i] *= c->wrench_decay;
    }
  }
  free(own);
  for (int k = 0; k < NX; ++k) f->xi[k] = LANE(s1[k], 0);
  for (int k = 0; k < NM; ++k) f->memory[k] = LANE(s1[NX + k], 0);
  for (int i = 0; i < 3; ++i) {
    f->xi[NX + i] *= c->wrench_decay;
    f->F[NX + i].at[NX + i] = c->wrench_decay;
    f->F[NX + 3 + i].at[NX + 3 + i] = 1.0;
  }
  spread(f);
  for (int k = 0; k < NX; ++k) f->P[k].at[k] += 1e-14; /* keeps the covariance regular on the constraint */
  for (int i = 0; i < 3; ++i) f->P[NX + i].at[NX + i] += c->wrench_variance[i];
}

/* Kalman update with three rows: innovation e, Jacobian H, derivatives dh (3, K), standard deviations sd */
static int update(Work *f, long K, const double *e, double H[3][N], const double *dh, const double *sd, double gate,
                  Sums *sums, double *whitened)
{
  double PH[N][3], S[3][3], L[3][3] = {{0}}, G[N][3], r[3];
  for (int i = 0; i < N; ++i)
    for (int a = 0; a < 3; ++a) {
      double sum = 0.0;
      for (int k = 0; k < N; ++k) sum += f->P[i].at[k] * H[a][k];
      PH[i][a] = sum;
    }
  for (int a = 0; a < 3; ++a)
    for (int b = 0; b < 3; ++b) {
      double sum = a == b ? sd[a] * sd[a] : 0.0;
      for (int k = 0; k < N; ++k) sum += H[a][k] * PH[k][b];
      S[a][b] = sum;
    }
  for (int a = 0; a < 3; ++a)
    for (int b = 0; b <= a; ++b) {
      double sum = S[a][b];
      for (int k = 0; k < b; ++k) sum -= L[a][k] * L[b][k];
      L[a][b] = a == b ? sqrt(sum) : sum / L[b][b];
    }
  double squared = 0.0;
  for (int a = 0; a < 3; ++a) {
    r[a] = e[a];
    for (int k = 0; k < a; ++k) r[a] -= L[a][k] * r[k];
    r[a] /= L[a][a];
    squared += r[a] * r[a];
  }
  if (!(squared < gate)) return 0;
  for (int i = 0; i < N; ++i) { /* G = P H^T S^-1 by the two triangular solves */
    double y[3];
    for (int a = 0; a < 3; ++a) {
      y[a] = PH[i][a];
      for (int k = 0; k < a; ++k) y[a] -= L[a][k] * y[k];
      y[a] /= L[a][a];
    }
    for (int a = 2; a >= 0; --a) {
      G[i][a] = y[a];
      for (int k = a + 1; k < 3; ++k) G[i][a] -= L[k][a] * G[i][k];
      G[i][a] /= L[a][a];
    }
  }
  for (int i = 0; i < N; ++i)
    for (int a = 0; a < 3; ++a) f->xi[i] += G[i][a] * e[a];
  for (int i = 0; i < N; ++i)
    for (int j = 0; j <= i; ++j) {
      double sum = f->P[i].at[j];
      for (int a = 0; a < 3; ++a) sum -= G[i][a] * PH[j][a];
      f->P[i].at[j] = f->P[j].at[i] = sum;
    }
  double J[3][K ? K : 1];
  for (long j = 0; j < K; ++j) {
    double *D = f->D + j * ND;
    for (int i = 0; i < N; ++i) {
      const int at = i < NX ? i : NS + i - NX;
      for (int a = 0; a < 3; ++a) D[at] -= G[i][a] * dh[a * K + j];
    }
    for (int a = 0; a < 3; ++a) { /* derivative of the whitened innovation */
      J[a][j] = -dh[a * K + j];
      for (int k = 0; k < a; ++k) J[a][j] -= L[a][k] * J[k][j];
      J[a][j] /= L[a][a];
    }
  }
  sums->log_likelihood -= 0.5 * squared + log(L[0][0] * L[1][1] * L[2][2]) + 1.5 * log(2.0 * M_PI);
  sums->samples += 3;
  for (int a = 0; a < 3; ++a) {
    whitened[a] = r[a];
    for (long i = 0; i < K; ++i) {
      sums->gradient[i] += r[a] * J[a][i];
      for (long j = 0; j <= i; ++j) sums->normal[i * K + j] += J[a][i] * J[a][j];
    }
  }
  return 1;
}

/* gyro about z and accelerometer: h = (scale r, R(-mu) acceleration in the head's frame) + bias */
static void measure_imu(const Settings *c, Work *f, long K, const double *z, const double *rate,
                        const double *tangent, double *dh, Sums *sums, double *whitened)
{
  const int q = c->links + 3;
  const double axis = f->xi[2] + c->imu_misalignment, cs = cos(axis), sn = sin(axis);
  const double forward = rate[q] * cs + rate[q + 1] * sn, left = rate[q + 1] * cs - rate[q] * sn;
  const double sd[3] = {c->gyro, c->accel, c->accel};
  double H[3][N] = {{0}};
  const double e[3] = {z[0] - c->gyro_scale * f->xi[q + 2] - f->xi[NX + 3], z[1] - forward - f->xi[NX + 4],
                       z[2] - left - f->xi[NX + 5]};
  for (long j = 0; j < NX + 3 + K; ++j) {
    const double *D = j < NX + 3 ? NULL : f->D + (j - NX - 3) * ND, *t = tangent + j * NX;
    const double turn = D ? D[2] : j == 2, spin = D ? D[q + 2] : j == q + 2;
    const double d[3] = {c->gyro_scale * spin, t[q] * cs + t[q + 1] * sn + left * turn,
                         t[q + 1] * cs - t[q] * sn - forward * turn};
    for (int a = 0; a < 3; ++a) {
      if (D) dh[a * K + j - NX - 3] = d[a] + D[NS + 3 + a];
      else H[a][j] = d[a];
    }
  }
  for (int a = 0; a < 3; ++a) H[a][NX + 3 + a] = 1.0;
  if (c->free_gyro >= 0) dh[c->free_gyro] += c->slope_gyro * f->xi[q + 2];
  if (c->free_misalignment >= 0) {
    dh[K + c->free_misalignment] += c->slope_misalignment * left;
    dh[2 * K + c->free_misalignment] -= c->slope_misalignment * forward;
  }
  update(f, K, e, H, dh, sd, c->gate_imu, sums, whitened);
}

/* camera pose at the grid point + offset */
static void measure_camera(const Settings *c, Work *f, long K, const double *z, double offset, const double *rate,
                           double *dh, Sums *sums, double *whitened)
{
  const int q = c->links + 3;
  const double gain[3] = {c->camera_scale, c->camera_scale, 1.0}, sd[3] = {c->position, c->position, c->heading};
  double H[3][N] = {{0}}, e[3], here[3], velocity[3];
  for (int a = 0; a < 3; ++a) {
    here[a] = f->xi[a] + offset * f->xi[q + a] + 0.5 * offset * offset * rate[q + a];
    velocity[a] = f->xi[q + a] + offset * rate[q + a];
    e[a] = z[a] - gain[a] * here[a] - (a == 2 ? c->camera_heading_offset : 0.0);
    H[a][a] = gain[a];
    H[a][q + a] = gain[a] * offset;
    for (long j = 0; j < K; ++j) dh[a * K + j] = gain[a] * (f->D[j * ND + a] + offset * f->D[j * ND + q + a]);
    if (c->free_latency >= 0) dh[a * K + c->free_latency] -= c->slope_latency * gain[a] * velocity[a];
    if (c->free_scale >= 0 && a < 2) dh[a * K + c->free_scale] += c->slope_scale * here[a];
  }
  e[2] = remainder(e[2], 2.0 * M_PI);
  if (c->free_heading >= 0) dh[2 * K + c->free_heading] += c->slope_heading;
  update(f, K, e, H, dh, sd, c->gate_camera, sums, whitened);
}

/* a matrix without its padding */
static void keep(const Row *from, double *to)
{
  for (int i = 0; i < N; ++i) memcpy(to + i * N, from[i].at, sizeof(double) * N);
}

/* Arrays: commands (steps, NC), imu (steps, 3) with NaN where missing, offset (steps) NaN without a frame,
   pose (steps, 3), p (NP), dp (K, NP), start (N), start_P (N, N), memory0 (NM), d_memory0 (K, NM).
   Results: sums[2] = log likelihood,
   samples; gradient (K); normal (K, K) lower triangle; whitened (steps, 6), NaN on entry. history NULL or
   (steps, 3 N N + 2 N + NM) rows: predicted xi, P, filtered xi, P, transition F to the next, memory. */
void filter_trial(long steps, long K, const double *commands, const double *imu, const double *offset,
                  const double *pose, const double *p, const double *dp, const Settings *c, const double *start,
                  const double *start_P, const double *memory0, const double *d_memory0, double *sums_out,
                  double *gradient, double *normal, double *whitened, double *history)
{
  Work f;
  Sums sums = {0.0, 0.0, gradient, normal};
  double rate[NX];
  double *tangent = malloc(sizeof(double) * (NX + 3 + K) * NX), *dh = malloc(sizeof(double) * 3 * (K ? K : 1));
  const long row = 3 * N * N + 2 * N + NM;
  substeps = (int)c->substeps;
  f.D = calloc((K ? K : 1) * ND, sizeof(double));
  memcpy(f.xi, start, sizeof f.xi);
  memset(f.P, 0, sizeof f.P);
  for (int i = 0; i < N; ++i) memcpy(f.P[i].at, start_P + i * N, sizeof(double) * N);
  memcpy(f.memory, memory0, sizeof f.memory);
  for (long j = 0; j < K; ++j) memcpy(f.D + j * ND + NX, d_memory0 + j * NM, sizeof f.memory);
  for (long k = 0; k < steps; ++k) {
    double *h = history ? history + k * row : NULL;
    if (h) { memcpy(h, f.xi, sizeof f.xi); keep(f.P, h + N); }
    const int has_imu = isfinite(imu[3 * k] + imu[3 * k + 1] + imu[3 * k + 2]), has_camera = isfinite(offset[k]);
    if (has_imu || has_camera) rates(c, &f, K, p, dp, commands + k * NC, f.xi, 0.0, 1, 0, NX + 3 + K, rate, tangent);
    if (has_imu) measure_imu(c, &f, K, imu + 3 * k, rate, tangent, dh, &sums, whitened + 6 * k);
    if (has_camera) measure_camera(c, &f, K, pose + 3 * k, offset[k], rate, dh, &sums, whitened + 6 * k + 3);
    if (h) {
      memcpy(h + N + N * N, f.xi, sizeof f.xi);
      keep(f.P, h + 2 * N + N * N);
      memcpy(h + 2 * N + 3 * N * N, f.memory, sizeof f.memory);
    }
    if (k + 1 < steps) predict(c, &f, K, p, dp, commands + k * NC);
    if (h) keep(f.F, h + 2 * N + 2 * N * N);
    if (!isfinite(f.xi[0])) {
      sums.log_likelihood = -INFINITY;
      for (h = history ? history + (k + 1) * row : NULL; h && h < history + steps * row; h += row)
        for (int i = 0; i < N; ++i) h[N + N * N + i] = NAN;
      break;
    }
  }
  sums_out[0] = sums.log_likelihood;
  sums_out[1] = sums.samples;
  free(tangent); free(dh); free(f.D);
}
