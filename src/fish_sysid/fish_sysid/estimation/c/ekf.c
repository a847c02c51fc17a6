/* Extended Kalman filter of one trial with forward sensitivities; see filter_types.py for the model.

   Stands behind fish_sim's kernel text: V, LANES, NQ, NX, NM, NS, NP, NC, NW, DT, SUBSTEPS (each thread's `substeps`),
   step, drive_at, rate, rate_and_vjp, follow, follow_jvp.
   N = NX + 6: motion, wrench on the head, biases of gyro and accelerometer. The motion's rates are few and what they
   depend on is much: their slopes come from adjoints, one rate in each lane; with them the derivatives along K free
   parameters are products, LANES parameters at a time. */
#include <stdlib.h>
#include <string.h>

#define N (NX + 6)
#define INNER (NX + 3) /* motion and wrench: what moves the motion */
#define ROWS (NX - NQ) /* accelerations and rates of effects' states; the first NQ rates are velocities of the motion */
#define SERIES 8       /* terms of the matrix exponential: 3e-6 where the fastest mode turns by 1 rad in half a substep */

/* vectors that hold n numbers */
#define VECTORS(n) (((n) + LANES - 1) / LANES)
#define WIDTH VECTORS(N)

typedef struct {
  double camera_latency, camera_heading_offset, camera_scale, gyro_scale, imu_misalignment; /* sensors */
  double slope_latency, slope_heading, slope_scale, slope_gyro, slope_misalignment; /* d sensor / d parameter */
  long free_latency, free_heading, free_scale, free_gyro, free_misalignment; /* index of the free parameter or -1 */
  long wrench_at[3];                                                         /* places in p */
  long substeps;
  double wrench_decay, wrench_variance[3]; /* per step of 10 ms */
  double gyro, accel, position, heading;   /* standard deviations */
  double gate_imu, gate_camera;            /* squared normalised innovation */
} Settings;

/* a row of a matrix of N columns, padded to whole vectors with zeros */
typedef union { double at[WIDTH * LANES]; V v[WIDTH]; } Row;

/* slopes of the ROWS rates along one number that they depend on */
typedef union { double at[VECTORS(ROWS) * LANES]; V v[VECTORS(ROWS)]; } Slope;
typedef struct { Slope x[NX], w[NW], p[NP]; } Slopes;

/* derivatives along LANES free parameters; the wrench's stand among those of the model's parameters, whose places it has */
typedef struct {
  V x[NX], memory[NM], next[NM], p[NP], bias[3];
  V h[3], innovation[3]; /* of a measurement, of its whitened innovation */
  V gradient;
} Directions;

typedef struct {
  Row P[N], F[N];
  double xi[N];
  V command[NC], memory[NM], next[NM], p[NP]; /* now and at the end of the period, the same in every lane */
  long K, blocks;                             /* free parameters, and the vectors that hold them */
  Directions *free, *end;                     /* `blocks` of them */
  int moved[NP], moved_count;                 /* places in p of what a free parameter or the wrench moves */
  V *normal;                                  /* (K, blocks): lower triangle */
  double log_likelihood, samples;
} Work;

/* parameters with the wrench at the current estimate */
static void set_wrench(const Settings *c, Work *f)
{
  for (int i = 0; i < 3; ++i) f->p[c->wrench_at[i]] = v_constant(f->xi[NX + i]);
}

/* what the actuators do in this period; no measurement changes it */
static void look_ahead(Work *f, const double *command)
{
  V zero[NC];
  for (int i = 0; i < NC; ++i) { f->command[i] = v_constant(command[i]); zero[i] = v_constant(0.0); }
  follow(f->memory, f->command, f->p, f->next);
  for (Directions *d = f->free; d < f->end; ++d)
    follow_jvp(f->memory, f->command, f->p, d->memory, zero, d->p, f->next, d->next);
}

/* rates of a motion at a fraction of the period, and the slopes of those beyond the velocities */
static void linearise(const Work *f, const double *motion, double fraction, double *rate, Slopes *slopes)
{
  V x[NX], w[NW], out[NX], gx[NX], gw[NW], gp[NP];
  for (int k = 0; k < NX; ++k) x[k] = v_constant(motion[k]);
  drive_at(f->memory, f->next, fraction, w);
  for (int block = 0; block < VECTORS(ROWS); ++block) {
    V g[NX];
    for (int k = 0; k < NX; ++k) g[k] = v_constant(0.0);
    for (int l = 0; l < LANES && block * LANES + l < ROWS; ++l) LANE(g[NQ + block * LANES + l], l) = 1.0;
    rate_and_vjp(x, w, f->p, g, out, gx, gw, gp);
    for (int k = 0; k < NX; ++k) slopes->x[k].v[block] = gx[k];
    for (int k = 0; k < NW; ++k) slopes->w[k].v[block] = gw[k];
    for (int k = 0; k < NP; ++k) slopes->p[k].v[block] = gp[k];
  }
  for (int k = 0; k < NX; ++k) rate[k] = LANE(out[k], 0);
}

/* rows of the rates' Jacobian, columns motion and wrench */
static void jacobian(const Settings *c, const Slopes *slopes, Row *A)
{
  memset(A, 0, NX * sizeof *A);
  for (int i = 0; i < NQ; ++i) A[i].at[NQ + i] = 1.0;
  for (int i = 0; i < ROWS; ++i) {
    for (int k = 0; k < NX; ++k) A[NQ + i].at[k] = slopes->x[k].at[i];
    for (int k = 0; k < 3; ++k) A[NQ + i].at[NX + k] = slopes->p[c->wrench_at[k]].at[i];
  }
}

/* sum += slope of each row times what it is along */
static inline void add_slopes(const Slope *slope, V along, V *sum)
{
#pragma GCC unroll 16
  for (int i = 0; i < ROWS; ++i) sum[i] += v_constant(slope->at[i]) * along;
}

/* derivatives of the rates beyond the velocities at a fraction of the period, the motion given: by actuators, parameters
   and wrench */
static void rates_along(const Work *f, const Slopes *slopes, double fraction, const Directions *d, V *sum)
{
  V dw[NW];
  drive_at(d->memory, d->next, fraction, dw);
  for (int i = 0; i < ROWS; ++i) sum[i] = v_constant(0.0);
  for (int k = 0; k < NW; ++k) add_slopes(slopes->w + k, dw[k], sum);
  for (int k = 0; k < f->moved_count; ++k) add_slopes(slopes->p + f->moved[k], d->p[f->moved[k]], sum);
}

/* y <- exp(A h) y + (integral of exp(A s) over 0 .. h) b: the series */
static void flow(const Row *A, const V *b, double h, V *y)
{
  V term[NX], next[NX];
  for (int k = 0; k < NX; ++k) term[k] = y[k];
  for (int m = 1; m <= SERIES; ++m) {
    for (int k = 0; k < NX; ++k) {
      V sum = m == 1 ? b[k] : v_constant(0.0);
#pragma GCC unroll 32
      for (int j = 0; j < NX; ++j) sum += v_constant(A[k].at[j]) * term[j];
      next[k] = v_constant(h / m) * sum;
    }
    for (int k = 0; k < NX; ++k) { term[k] = next[k]; y[k] += next[k]; }
  }
}

/* out = a b: `rows` rows of a, the first `inner` of their columns, `width` vectors of the rows of b */
static inline void multiply(const Row *a, const Row *b, int rows, int inner, int width, Row *out)
{
  for (int i = 0; i < rows; ++i) {
    V sum[WIDTH];
    for (int w = 0; w < width; ++w) sum[w] = v_constant(0.0);
    for (int k = 0; k < inner; ++k)
#pragma GCC unroll 32
      for (int w = 0; w < width; ++w) sum[w] += v_constant(a[i].at[k]) * b[k].v[w];
    for (int w = 0; w < width; ++w) out[i].v[w] = sum[w];
  }
}

/* P <- F P F^T, exactly symmetric; wrench and biases only decay */
static void spread(Work *f)
{
  Row T[NX], Ft[N];
  memset(Ft, 0, sizeof Ft);
  for (int i = 0; i < N; ++i)
    for (int j = 0; j < N; ++j) Ft[i].at[j] = f->F[j].at[i];
  multiply(f->F, f->P, NX, INNER, WIDTH, T);
  multiply(T, Ft, NX, N, WIDTH, f->P);
  for (int i = 0; i < N; ++i)
    for (int j = 0; j < i && j < NX; ++j) f->P[i].at[j] = f->P[j].at[i];
  for (int i = NX; i < N; ++i)
    for (int j = NX; j < N; ++j) f->P[i].at[j] *= f->F[i].at[i] * f->F[j].at[j];
}

/* motion at a fraction of the period that led from x0 to x1 with these rates at its ends: Hermite's cubic */
static void between(const V *x0, const V *x1, const V *rate0, const V *rate1, double c, double *motion)
{
  for (int k = 0; k < NX; ++k) {
    const double a = LANE(x0[k], 0), b = LANE(x1[k], 0), va = DT * LANE(rate0[k], 0), vb = DT * LANE(rate1[k], 0);
    motion[k] = a + (b - a) * c * c * (3.0 - 2.0 * c) + c * (1.0 - c) * ((1.0 - c) * va - c * vb);
  }
}

/* Half a step of x' = A x + b is x <- E x + G b: G the integral of exp(A s) over it, E = exp(A h) = 1 + G A. `rates` are
   the rows of A and, for the wrench's columns, of b; so are the rows of `half` those of E and G b, the wrench held. */
static void half_step(const Row *rates, Row *half, Row *G)
{
  for (int w = 0; w < VECTORS(NX); ++w) {
    V unit[NX], g[NX];
    for (int k = 0; k < NX; ++k) unit[k] = g[k] = v_constant(0.0);
    for (int l = 0; l < LANES && w * LANES + l < NX; ++l) LANE(unit[w * LANES + l], l) = 1.0;
    for (int sub = 0; sub < SUBSTEPS; ++sub) flow(rates, unit, 0.5 * DT / SUBSTEPS, g);
    for (int k = 0; k < NX; ++k) G[k].v[w] = g[k];
  }
  multiply(G, rates, NX, NX, VECTORS(INNER), half);
  memset(half + NX, 0, 3 * sizeof *half);
  for (int k = 0; k < INNER; ++k) half[k].at[k] += 1.0;
}

/* One step of 10 ms: estimate, covariance, derivatives. The estimate takes the simulator's step. Its tangents follow
   x' = A x + b, the Jacobian A taken in the middle of the step and the parameters' b in the middle of each half, instead of
   the integrator's stages. Against these: 0.1 nats in 90,000, standard errors to 2 %, at half the time. */
static void predict(const Settings *c, Work *f)
{
  V s0[NS], s1[NS], rate0[NX], rate1[NX], w[NW];
  double at[NX], unused[NX];
  Row A[NX], half[INNER], G[NX];
  Slopes slopes;
  for (int k = 0; k < NX; ++k) s0[k] = s1[k] = v_constant(f->xi[k]);
  for (int k = 0; k < NM; ++k) s0[NX + k] = s1[NX + k] = f->memory[k];
  step(s1, f->command, f->p);
  drive_at(f->memory, f->next, 0.0, w);
  rate(s0, w, f->p, rate0);
  drive_at(f->memory, f->next, 1.0, w);
  rate(s1, w, f->p, rate1);

  between(s0, s1, rate0, rate1, 0.5, at);
  linearise(f, at, 0.5, unused, &slopes);
  jacobian(c, &slopes, A);
  half_step(A, half, G);
  multiply(half, half, NX, INNER, VECTORS(INNER), f->F);
  for (int part = 0; f->blocks && part < 2; ++part) {
    const double fraction = 0.25 + 0.5 * part;
    between(s0, s1, rate0, rate1, fraction, at);
    linearise(f, at, fraction, unused, &slopes);
    for (Directions *d = f->free; d < f->end; ++d) {
      V next[NX], own[ROWS];
      rates_along(f, &slopes, fraction, d, own);
      for (int k = 0; k < NX; ++k) {
        next[k] = v_constant(0.0);
#pragma GCC unroll 32
        for (int j = 0; j < NX; ++j) next[k] += v_constant(half[k].at[j]) * d->x[j];
#pragma GCC unroll 16
        for (int i = 0; i < ROWS; ++i) next[k] += v_constant(G[k].at[NQ + i]) * own[i];
      }
      memcpy(d->x, next, sizeof next);
    }
  }
  for (Directions *d = f->free; d < f->end; ++d) {
    memcpy(d->memory, d->next, sizeof d->memory);
    for (int i = 0; i < 3; ++i) d->p[c->wrench_at[i]] *= v_constant(c->wrench_decay);
  }
  for (int k = 0; k < NX; ++k) f->xi[k] = LANE(s1[k], 0);
  memcpy(f->memory, f->next, sizeof f->memory);
  for (int i = 0; i < 3; ++i) f->xi[NX + i] *= c->wrench_decay;
  set_wrench(c, f);
  spread(f);
  for (int k = 0; k < NX; ++k) f->P[k].at[k] += 1e-14; /* keeps the covariance regular on the constraint */
  for (int i = 0; i < 3; ++i) f->P[NX + i].at[NX + i] += c->wrench_variance[i];
}

/* Kalman update with three rows: innovation e, Jacobian H, standard deviations sd; the derivatives of what was expected
   along the free parameters stand in their h */
static void update(const Settings *c, Work *f, const double *e, const Row *H, const double *sd, double gate,
                   double *whitened)
{
  Row PH[3], W[3], G[3]; /* P H^T, W = P H^T L^-T, gain G = P H^T S^-1, column by column; S = L L^T */
  double S[3][3], L[3][3] = {{0}}, r[3];
  multiply(H, f->P, 3, N, WIDTH, PH);
  for (int a = 0; a < 3; ++a)
    for (int b = 0; b <= a; ++b) {
      S[a][b] = a == b ? sd[a] * sd[a] : 0.0;
      for (int k = 0; k < N; ++k) S[a][b] += H[a].at[k] * PH[b].at[k];
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
  if (!(squared < gate)) return;
  for (int w = 0; w < WIDTH; ++w) { /* the two triangular solves */
    for (int a = 0; a < 3; ++a) {
      V y = PH[a].v[w];
      for (int k = 0; k < a; ++k) y -= v_constant(L[a][k]) * W[k].v[w];
      W[a].v[w] = y / v_constant(L[a][a]);
    }
    for (int a = 2; a >= 0; --a) {
      V g = W[a].v[w];
      for (int k = a + 1; k < 3; ++k) g -= v_constant(L[k][a]) * G[k].v[w];
      G[a].v[w] = g / v_constant(L[a][a]);
    }
  }
  for (int i = 0; i < N; ++i) {
    for (int a = 0; a < 3; ++a) f->xi[i] += G[a].at[i] * e[a];
    for (int w = 0; w < WIDTH; ++w) /* P - W W^T is exactly symmetric */
      for (int a = 0; a < 3; ++a) f->P[i].v[w] -= v_constant(W[a].at[i]) * W[a].v[w];
  }
  set_wrench(c, f);
  for (long block = 0; block < f->blocks; ++block) {
    Directions *const d = f->free + block;
    for (int a = 0; a < 3; ++a) {
      for (int k = 0; k < NX; ++k) d->x[k] -= v_constant(G[a].at[k]) * d->h[a];
      for (int i = 0; i < 3; ++i) {
        d->p[c->wrench_at[i]] -= v_constant(G[a].at[NX + i]) * d->h[a];
        d->bias[i] -= v_constant(G[a].at[NX + 3 + i]) * d->h[a];
      }
      V y = -d->h[a];
      for (int k = 0; k < a; ++k) y -= v_constant(L[a][k]) * d->innovation[k];
      d->innovation[a] = y / v_constant(L[a][a]);
      d->gradient += v_constant(r[a]) * d->innovation[a];
    }
    for (long i = block * LANES; i < f->K && i < (block + 1) * LANES; ++i)
      for (long other = 0; other <= block; ++other)
        for (int a = 0; a < 3; ++a)
          f->normal[i * f->blocks + other] +=
            v_constant(LANE(d->innovation[a], i - block * LANES)) * f->free[other].innovation[a];
  }
  f->log_likelihood -= 0.5 * squared + log(L[0][0] * L[1][1] * L[2][2]) + 1.5 * log(2.0 * M_PI);
  f->samples += 3;
  memcpy(whitened, r, sizeof r);
}

/* adds to what a free sensor parameter does to row a of a measurement; nothing where it is not free */
static void add_slope(Work *f, long parameter, int a, double slope)
{
  if (parameter >= 0) LANE(f->free[parameter / LANES].h[a], parameter % LANES) += slope;
}

/* gyro about z and accelerometer: h = (scale r, R(-mu) acceleration in the head's frame) + bias */
static void measure_imu(const Settings *c, Work *f, const double *z, const double *rate, const Slopes *slopes,
                        double *whitened)
{
  const double axis = f->xi[2] + c->imu_misalignment, cs = cos(axis), sn = sin(axis);
  const double forward = rate[NQ] * cs + rate[NQ + 1] * sn, left = rate[NQ + 1] * cs - rate[NQ] * sn;
  const double sd[3] = {c->gyro, c->accel, c->accel};
  const double e[3] = {z[0] - c->gyro_scale * f->xi[NQ + 2] - f->xi[NX + 3], z[1] - forward - f->xi[NX + 4],
                       z[2] - left - f->xi[NX + 5]};
  Row A[NX], H[3] = {{{0}}};
  jacobian(c, slopes, A);
  for (int w = 0; w < VECTORS(INNER); ++w) {
    H[1].v[w] = v_constant(cs) * A[NQ].v[w] + v_constant(sn) * A[NQ + 1].v[w];
    H[2].v[w] = v_constant(cs) * A[NQ + 1].v[w] - v_constant(sn) * A[NQ].v[w];
  }
  H[0].at[NQ + 2] = c->gyro_scale;
  H[1].at[2] += left;
  H[2].at[2] -= forward;
  for (int a = 0; a < 3; ++a) H[a].at[NX + 3 + a] = 1.0;
  for (Directions *d = f->free; d < f->end; ++d) {
    V rates[ROWS];
    rates_along(f, slopes, 0.0, d, rates);
    for (int k = 0; k < NX; ++k) add_slopes(slopes->x + k, d->x[k], rates);
    const V turn = d->x[2], spin = d->x[NQ + 2];
    d->h[0] = v_constant(c->gyro_scale) * spin + d->bias[0];
    d->h[1] = rates[0] * v_constant(cs) + rates[1] * v_constant(sn) + v_constant(left) * turn + d->bias[1];
    d->h[2] = rates[1] * v_constant(cs) - rates[0] * v_constant(sn) - v_constant(forward) * turn + d->bias[2];
  }
  add_slope(f, c->free_gyro, 0, c->slope_gyro * f->xi[NQ + 2]);
  add_slope(f, c->free_misalignment, 1, c->slope_misalignment * left);
  add_slope(f, c->free_misalignment, 2, -c->slope_misalignment * forward);
  update(c, f, e, H, sd, c->gate_imu, whitened);
}

/* camera pose at the grid point + offset */
static void measure_camera(const Settings *c, Work *f, const double *z, double offset, const double *rate,
                           double *whitened)
{
  const double gain[3] = {c->camera_scale, c->camera_scale, 1.0}, sd[3] = {c->position, c->position, c->heading};
  double e[3];
  Row H[3] = {{{0}}};
  for (int a = 0; a < 3; ++a) {
    const double here = f->xi[a] + offset * f->xi[NQ + a] + 0.5 * offset * offset * rate[NQ + a];
    const double velocity = f->xi[NQ + a] + offset * rate[NQ + a];
    e[a] = z[a] - gain[a] * here - (a == 2 ? c->camera_heading_offset : 0.0);
    H[a].at[a] = gain[a];
    H[a].at[NQ + a] = gain[a] * offset;
    for (Directions *d = f->free; d < f->end; ++d)
      d->h[a] = v_constant(gain[a]) * (d->x[a] + v_constant(offset) * d->x[NQ + a]);
    add_slope(f, c->free_latency, a, -c->slope_latency * gain[a] * velocity);
    if (a < 2) add_slope(f, c->free_scale, a, c->slope_scale * here);
  }
  e[2] = remainder(e[2], 2.0 * M_PI);
  add_slope(f, c->free_heading, 2, c->slope_heading);
  update(c, f, e, H, sd, c->gate_camera, whitened);
}

/* a matrix without its padding */
static void keep(const Row *from, double *to)
{
  for (int i = 0; i < N; ++i) memcpy(to + i * N, from[i].at, sizeof(double) * N);
}

/* `size` bytes of zeros that vectors may stand in; NULL where there is no memory */
static void *zeros(size_t size)
{
  void *room = aligned_alloc(sizeof(V), size ? size : sizeof(V));
  return room ? memset(room, 0, size) : NULL;
}

/* the state and its derivatives before the first measurement */
static void begin(const Settings *c, Work *f, const double *p, const double *dp, const double *start,
                  const double *start_P, const double *memory0, const double *d_memory0)
{
  memset(f->P, 0, sizeof f->P);
  memset(f->F, 0, sizeof f->F);
  for (int i = 0; i < N; ++i) memcpy(f->P[i].at, start_P + i * N, sizeof(double) * N);
  for (int i = NX; i < N; ++i) f->F[i].at[i] = i < INNER ? c->wrench_decay : 1.0;
  memcpy(f->xi, start, sizeof f->xi);
  for (int k = 0; k < NM; ++k) f->memory[k] = v_constant(memory0[k]);
  for (int k = 0; k < NP; ++k) f->p[k] = v_constant(p[k]);
  set_wrench(c, f);
  for (int k = 0; k < NP; ++k) {
    int moved = k == c->wrench_at[0] || k == c->wrench_at[1] || k == c->wrench_at[2];
    for (long j = 0; j < f->K; ++j) moved |= dp[j * NP + k] != 0.0;
    if (moved) f->moved[f->moved_count++] = k;
  }
  for (long j = 0; j < f->K; ++j) {
    Directions *const d = f->free + j / LANES;
    for (int k = 0; k < NM; ++k) LANE(d->memory[k], j % LANES) = d_memory0[j * NM + k];
    for (int k = 0; k < NP; ++k) LANE(d->p[k], j % LANES) = dp[j * NP + k];
    for (int i = 0; i < 3; ++i) LANE(d->p[c->wrench_at[i]], j % LANES) = 0.0;
  }
}

/* Arrays: commands (steps, NC), imu (steps, 3) with NaN where missing, offset (steps) NaN without a frame,
   pose (steps, 3), p (NP), dp (K, NP), start (N), start_P (N, N), memory0 (NM), d_memory0 (K, NM).
   Results: sums[2] = log likelihood,
   samples; gradient (K); normal (K, K) lower triangle; whitened (steps, 6), NaN on entry. history NULL or
   (steps, 3 N N + 2 N + NM) rows: predicted xi, P, filtered xi, P, transition F to the next, memory.
   Returns 0, or 1 where there is no memory for it. */
int filter_trial(long steps, long K, const double *commands, const double *imu, const double *offset,
                 const double *pose, const double *p, const double *dp, const Settings *c, const double *start,
                 const double *start_P, const double *memory0, const double *d_memory0, double *sums,
                 double *gradient, double *normal, double *whitened, double *history)
{
  Work f = {.K = K, .blocks = VECTORS(K)};
  double rate[NX];
  Slopes slopes;
  const long row = 3 * N * N + 2 * N + NM;
  f.free = zeros(sizeof *f.free * f.blocks);
  f.normal = zeros(sizeof *f.normal * K * f.blocks);
  if (!f.free || !f.normal) { free(f.free); free(f.normal); return 1; }
  f.end = f.free + f.blocks;
  substeps = (int)c->substeps;
  begin(c, &f, p, dp, start, start_P, memory0, d_memory0);
  for (long k = 0; k < steps; ++k) {
    double *h = history ? history + k * row : NULL;
    if (h) { memcpy(h, f.xi, sizeof f.xi); keep(f.P, h + N); }
    const int has_imu = isfinite(imu[3 * k] + imu[3 * k + 1] + imu[3 * k + 2]), has_camera = isfinite(offset[k]);
    look_ahead(&f, commands + k * NC);
    if (has_imu || has_camera) linearise(&f, f.xi, 0.0, rate, &slopes);
    if (has_imu) measure_imu(c, &f, imu + 3 * k, rate, &slopes, whitened + 6 * k);
    if (has_camera) measure_camera(c, &f, pose + 3 * k, offset[k], rate, whitened + 6 * k + 3);
    if (h) {
      memcpy(h + N + N * N, f.xi, sizeof f.xi);
      keep(f.P, h + 2 * N + N * N);
      for (int i = 0; i < NM; ++i) h[2 * N + 3 * N * N + i] = LANE(f.memory[i], 0);
    }
    if (k + 1 < steps) predict(c, &f);
    if (h) keep(f.F, h + 2 * N + 2 * N * N);
    if (!isfinite(f.xi[0])) {
      f.log_likelihood = -INFINITY;
      for (h = history ? history + (k + 1) * row : NULL; h && h < history + steps * row; h += row)
        for (int i = 0; i < N; ++i) h[N + N * N + i] = NAN;
      break;
    }
  }
  sums[0] = f.log_likelihood;
  sums[1] = f.samples;
  for (long i = 0; i < K; ++i) {
    gradient[i] = LANE(f.free[i / LANES].gradient, i % LANES);
    for (long j = 0; j <= i; ++j) normal[i * K + j] = LANE(f.normal[i * f.blocks + j / LANES], j % LANES);
  }
  free(f.free); free(f.normal);
  return 0;
}
