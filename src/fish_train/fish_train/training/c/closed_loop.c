/* A window of the closed loop, forward and backward, LANES fish at a time.

   Before this text stand fish_sim's kernel (V, step, step_vjp, NS, NC, NP), the functions emitted from
   kernel.py and mlp.h, path_search.h. One period: sense, policy (every `hold` periods; its gains are kept in
   between), act, PHYSICS times (drive, step).
   Sizes: NO motion, NU guidance, NK control, NA actuator, NL last, NI inputs, NE errors, NR report, NGAIN gains,
   NCOST cost weights, HISTORY past motions (one a
   physics step) kept for delayed vision. Motions are counted in physics steps from the start of the window. */

#define NSEEN (PHYSICS * NO) /* what is seen in a period: its motions, oldest first */

#define SENSE_OUT (NI + NE + NU + NR + 1)
#define ACT_OUT (NK + NL + 1)
#define MAX_LAYERS 8

/* everything that one period leaves behind for the reverse sweep */
typedef struct {
  V plant[PHYSICS][NS], actuator[PHYSICS][NA], command[PHYSICS][NC];
  V guidance[NU], control[NK], last[NL];
  V seen[NSEEN], near[NG], real[NG], sensed[SENSE_OUT], raw[PAD(NGAIN)], acted[ACT_OUT];
} Period;

typedef struct {
  long layers, columns, size[MAX_LAYERS + 1];
  double *panels[MAX_LAYERS], *transposed[MAX_LAYERS];   /* room for the repacked weights */
  double *activation[MAX_LAYERS], *adjoint[MAX_LAYERS]; /* (size, columns): input of layer l, adjoint of its output */
  const double *bias[MAX_LAYERS];
} Network;

typedef struct {
  long batch, steps, hold, gradient; /* steps: control periods, a multiple of hold */
  const double *p;          /* (batch, NP) */
  const double *speed;      /* (batch) wanted */
  const double *cost;       /* (NCOST) */
  const double *noise;      /* (steps + 1, batch, NO), added to what is seen */
  const long *delay;        /* (batch) physics steps, how old what is seen is */
  const long *path;         /* (batch) index of its path */
  double *plant;            /* (batch, NS) in and out, like the following */
  double *memory;           /* (batch, NU + NK + NA + NL) */
  double *place;            /* (batch, 4): seen progress, captured; true progress, captured */
  double *history;          /* (batch, HISTORY, NO), newest last */
  double *report;           /* (steps + 1, batch, NR) */
  double *gains;            /* (steps, batch, NL) */
  double *value;            /* (batch) summed cost */
} Window;

static void zero(V *v, long n) { for (long k = 0; k < n; ++k) v[k] = v_constant(0.0); }
static void copy(const V *from, long n, V *to) { for (long k = 0; k < n; ++k) to[k] = from[k]; }
static void add(const V *from, long n, V *to) { for (long k = 0; k < n; ++k) to[k] += from[k]; }

/* raw outputs of the policy; every layer's input goes to columns `column` on of the activation matrices */
static void policy_forward(const Network *net, const V *inputs, long column, V *work, V *raw)
{
  V *h = work, *next = work + PAD(net->size[0]);
  copy(inputs, net->size[0], h);
  for (long l = 0; l < net->layers; ++l) {
    for (long k = 0; k < net->size[l]; ++k) *(V *)(net->activation[l] + k * net->columns + column) = h[k];
    const int final = l == net->layers - 1;
    affine(net->panels[l], net->bias[l], net->size[l + 1], net->size[l], h, final ? raw : next);
    if (final) return;
    for (long k = 0; k < net->size[l + 1]; ++k) next[k] = v_positive(next[k]);
    h = next;
    next += PAD(net->size[l + 1]);
  }
}

/* adjoint of the inputs from that of the raw outputs; adjoints of every layer's output are kept */
static void policy_backward(const Network *net, const V *g_raw, long column, V *work, V *g_inputs)
{
  const V *g = g_raw;
  for (long l = net->layers - 1; l >= 0; --l) {
    for (long k = 0; k < net->size[l + 1]; ++k) *(V *)(net->adjoint[l] + k * net->columns + column) = g[k];
    V *before = l == 0 ? g_inputs : work;
    affine(net->transposed[l], NULL, net->size[l], net->size[l + 1], g, before);
    if (l == 0) return;
    for (long k = 0; k < net->size[l]; ++k)
      before[k] = v_where_positive(*(V *)(net->activation[l] + k * net->columns + column), before[k]);
    g = before;
    work += PAD(net->size[l]);
  }
}

/* lane l sees what was true delay[l] steps ago */
static void look(const Window *w, const V *motions, long t, long first, V *seen)
{
  for (int l = 0; l < LANES; ++l) {
    const long b = first + l < w->batch ? first + l : w->batch - 1;
    const V *row = motions + (HISTORY + PHYSICS * (t - 1) + 1 - w->delay[b]) * NO;
    for (int k = 0; k < NSEEN; ++k) LANE(seen[k], l) = LANE(row[k], l) + w->noise[(t * w->batch + b) * NO + k % NO];
  }
}

static void look_adjoint(const Window *w, const V *g_seen, long t, long first, V *g_motion)
{
  for (int l = 0; l < LANES; ++l) {
    const long b = first + l < w->batch ? first + l : w->batch - 1;
    const long at = (PHYSICS * (t - 1) + 1 - w->delay[b]) * NO; /* what was before the window is given */
    for (long k = at < 0 ? -at : 0; k < NSEEN; ++k) LANE(g_motion[at + k], l) += LANE(g_seen[k], l);
  }
}

static void find_places(const Window *w, const Path *paths, const Search *search, long first, int which, const V *o,
                        V *geometry)
{
  for (int l = 0; l < LANES; ++l) {
    const long b = first + l < w->batch ? first + l : w->batch - 1;
    Place place = {w->place[4 * b + 2 * which], w->place[4 * b + 2 * which + 1]};
    locate(paths + w->path[b], search, &place, LANE(o[0], l), LANE(o[1], l), (double *)geometry + l, LANES);
    if (first + l < w->batch) w->place[4 * b + 2 * which] = place.progress, w->place[4 * b + 2 * which + 1] = place.captured;
  }
}

/* does any fish of the block see something else than the truth */
static int sees_truth(const Window *w, long first)
{
  for (long b = first; b < first + LANES && b < w->batch; ++b) {
    if (w->delay[b]) return 0;
    for (long t = 0; t <= w->steps; ++t)
      for (int k = 0; k < NO; ++k)
        if (w->noise[(t * w->batch + b) * NO + k] != 0.0) return 0;
  }
  return 1;
}

static void sense_period(const Window *w, const Path *paths, const Search *search, long first, long t, int perfect,
                         const V *motions, const V *speed, const V *cost, Period *now)
{
  const V *true_motion = motions + (HISTORY + PHYSICS * t) * NO;
  double kept[4 * LANES];
  look(w, motions, t, first, now->seen);
  for (int l = 0; l < LANES && first + l < w->batch; ++l)
    for (int k = 0; k < 4; ++k) kept[4 * l + k] = w->place[4 * (first + l) + k];
  find_places(w, paths, search, first, 0, now->seen + NSEEN - NO, now->near);
  if (perfect) copy(now->near, NG, now->real);
  else find_places(w, paths, search, first, 1, true_motion, now->real);
  for (int l = 0; l < LANES && first + l < w->batch; ++l) {
    double *place = w->place + 4 * (first + l);
    if (perfect) place[2] = place[0], place[3] = place[1];
    if (t == w->steps) /* the next window looks again at its first period */
      for (int k = 0; k < 4; ++k) place[k] = kept[4 * l + k];
  }
  sense(now->seen, true_motion, now->guidance, now->last + NGAIN, now->near, now->real, speed, cost, now->sensed);
  scatter(now->sensed + NI + NE + NU, NR, first, w->batch, w->report + t * w->batch * NR);
}

static void advance_period(const Window *w, const Network *net, long first, long t, const V *cost, const V *p, V *work,
                           Period *now, Period *next, V *motions_next)
{
  V driven[NA + NC];
  if (t % w->hold == 0) policy_forward(net, now->sensed, t / w->hold * LANES, work, now->raw);
  act(now->sensed + NI, now->control, now->last, now->raw, cost, now->acted);
  copy(now->sensed + NI + NE, NU, next->guidance);
  copy(now->acted, NK, next->control);
  copy(now->acted + NK, NL, next->last);
  copy(now->raw, NGAIN, next->raw);
  scatter(next->last, NL, first, w->batch, w->gains + t * w->batch * NL);
  for (int k = 0; k < PHYSICS; ++k) {
    V *plant = k + 1 < PHYSICS ? now->plant[k + 1] : next->plant[0];
    drive(now->actuator[k], next->last + NGAIN, driven);
    copy(driven, NA, k + 1 < PHYSICS ? now->actuator[k + 1] : next->actuator[0]);
    copy(driven + NA, NC, now->command[k]);
    copy(now->plant[k], NS, plant);
    step(plant, now->command[k], p);
    motion(plant, plant + NQ, motions_next + k * NO);
  }
}

/* adjoints that travel from period to period */
typedef struct { V plant[NS], guidance[NU], control[NK], actuator[NA], last[NL], raw[PAD(NGAIN)]; } Adjoint;

static void motion_reverse(const V *plant, const V *g_motion, V *g_plant)
{
  V gq[3], gqd[3];
  motion_vjp(plant, plant + NQ, g_motion, gq, gqd);
  add(gq, 3, g_plant);
  add(gqd, 3, g_plant + NQ);
}

/* reverse of sense_period: gs holds the adjoint of all its outputs */
static void sense_reverse(const Window *w, long first, long t, const V *motions, const V *speed, const V *cost,
                          const Period *now, const V *gs, V *g_motion, Adjoint *g)
{
  V g_seen[NSEEN], g_true[NO], g_setpoint[NC];
  sense_vjp(now->seen, motions + (HISTORY + PHYSICS * t) * NO, now->guidance, now->last + NGAIN, now->near, now->real, speed,
            cost, gs, g_seen, g_true, g->guidance, g_setpoint);
  add(g_setpoint, NC, g->last + NGAIN);
  add(g_true, NO, g_motion + PHYSICS * t * NO);
  look_adjoint(w, g_seen, t, first, g_motion);
}

/* reverse of advance_period: g of the period after becomes g of this period, before its sensing; gs receives the
   adjoint of what was sensed */
static void advance_reverse(const Window *w, const Network *net, long first, long t, const V *cost, const V *p,
                            const V *seed, const V *g_motion, V *work, const Period *now, Adjoint *g,
                            V *gs)
{
  V g_command[NC], g_driven[NA + NC], g_actuator[NA], g_setpoint[NC], g_acted[ACT_OUT], g_raw[NGAIN], g_errors[NE],
    gp[NP];
  zero(gp, NP);
  copy(g->control, NK, g_acted);
  copy(g->last, NL, g_acted + NK);
  g_acted[NK + NL] = *seed;
  for (int k = PHYSICS - 1; k >= 0; --k) {
    zero(g_command, NC);
    step_vjp(now->plant[k], g->plant, now->command[k], g_command, p, gp);
    if (k > 0) motion_reverse(now->plant[k], g_motion + (PHYSICS * t + k) * NO, g->plant);
    copy(g->actuator, NA, g_driven);
    copy(g_command, NC, g_driven + NA);
    drive_vjp(now->actuator[k], now->acted + NK + NGAIN, g_driven, g_actuator, g_setpoint);
    copy(g_actuator, NA, g->actuator);
    add(g_setpoint, NC, g_acted + NK + NGAIN);
  }
  act_vjp(now->sensed + NI, now->control, now->last, now->raw, cost, g_acted, g_errors, g->control, g->last, g_raw);
  add(g_raw, NGAIN, g->raw);
  zero(gs, NI);
  if (t % w->hold == 0) {
    policy_backward(net, g->raw, t / w->hold * LANES, work, gs);
    zero(g->raw, NGAIN);
  }
  copy(g_errors, NE, gs + NI);
  copy(g->guidance, NU, gs + NI + NE);
  zero(gs + NI + NE + NU, NR);
}

static void backward(const Window *w, const Network *net, long first, const V *motions, const V *speed, const V *cost,
                     const V *p, V *work, Period *periods, V *g_motion)
{
  Adjoint g;
  V seed, gs[SENSE_OUT + BLOCK];
  zero((V *)&g, sizeof g / sizeof(V));
  zero(g_motion, (PHYSICS * w->steps + 1) * NO);
  for (int l = 0; l < LANES; ++l) LANE(seed, l) = first + l < w->batch ? 1.0 / (w->batch * w->steps) : 0.0;
  zero(gs, SENSE_OUT);
  gs[SENSE_OUT - 1] = seed;
  sense_reverse(w, first, w->steps, motions, speed, cost, periods + w->steps, gs, g_motion, &g);
  motion_reverse(periods[w->steps].plant[0], g_motion + PHYSICS * w->steps * NO, g.plant);
  for (long t = w->steps - 1; t >= 0; --t) {
    advance_reverse(w, net, first, t, cost, p, &seed, g_motion, work, periods + t, &g, gs);
    if (t == 0) return; /* the window's start is given */
    gs[SENSE_OUT - 1] = seed;
    sense_reverse(w, first, t, motions, speed, cost, periods + t, gs, g_motion, &g);
    motion_reverse(periods[t].plant[0], g_motion + PHYSICS * t * NO, g.plant);
  }
}

static void load(const Window *w, long first, Period *now, V *p, V *speed, V *motions)
{
  V memory[NU + NK + NA + NL];
  gather(w->plant, NS, NS, first, w->batch, now->plant[0]);
  gather(w->memory, NU + NK + NA + NL, NU + NK + NA + NL, first, w->batch, memory);
  gather(w->p, NP, NP, first, w->batch, p);
  gather(w->speed, 1, 1, first, w->batch, speed);
  gather(w->history, HISTORY * NO, HISTORY * NO, first, w->batch, motions);
  copy(memory, NU, now->guidance);
  copy(memory + NU, NK, now->control);
  copy(memory + NU + NK, NA, now->actuator[0]);
  copy(memory + NU + NK + NA, NL, now->last);
  motion(now->plant[0], now->plant[0] + NQ, motions + HISTORY * NO);
}

static void store(const Window *w, long first, const Period *now, const V *motions, const V *value)
{
  V memory[NU + NK + NA + NL];
  copy(now->guidance, NU, memory);
  copy(now->control, NK, memory + NU);
  copy(now->actuator[0], NA, memory + NU + NK);
  copy(now->last, NL, memory + NU + NK + NA);
  scatter(now->plant[0], NS, first, w->batch, w->plant);
  scatter(memory, NU + NK + NA + NL, first, w->batch, w->memory);
  scatter(motions + PHYSICS * w->steps * NO, HISTORY * NO, first, w->batch, w->history);
  scatter(value, 1, first, w->batch, w->value);
}

/* lay the flat weights out for `affine`; the network points into them afterwards */
void repack(Network *net, const double *weights, long gradient)
{
  for (long l = 0; l < net->layers; ++l) {
    const long n_in = net->size[l], n_out = net->size[l + 1];
    pack(weights, n_out, n_in, 0, net->panels[l]);
    if (gradient) pack(weights, n_out, n_in, 1, net->transposed[l]);
    net->bias[l] = weights + n_out * n_in;
    weights = net->bias[l] + n_out;
  }
}

/* bytes for the periods, motions and their adjoints and the policy's work (units in all its layers) of one block */
long scratch_size(long steps, long units)
{
  return (steps + 1) * sizeof(Period) + ((2 * (PHYSICS * steps + 1) + HISTORY) * NO + units) * sizeof(V);
}

/* the LANES fish from `first` on; scratch: scratch_size bytes, 64-byte aligned like the activation matrices */
void run_block(const Window *w, const Network *net, const Path *paths, const Search *search, long first, void *scratch)
{
  Period *periods = scratch;
  V *motions = (V *)(periods + w->steps + 1), *g_motion = motions + (HISTORY + PHYSICS * w->steps + 1) * NO;
  V *work = g_motion + (PHYSICS * w->steps + 1) * NO, p[NP], speed[1], cost[NCOST], value = v_constant(0.0);
  const int perfect = sees_truth(w, first);
  for (int k = 0; k < NCOST; ++k) cost[k] = v_constant(w->cost[k]);
  load(w, first, periods, p, speed, motions);
  for (long t = 0; t < w->steps; ++t) {
    V *motions_next = motions + (HISTORY + PHYSICS * t + 1) * NO;
    sense_period(w, paths, search, first, t, perfect, motions, speed, cost, periods + t);
    advance_period(w, net, first, t, cost, p, work, periods + t, periods + t + 1, motions_next);
    if (t > 0) value += periods[t].sensed[SENSE_OUT - 1];
    value += periods[t].acted[ACT_OUT - 1];
  }
  sense_period(w, paths, search, first, w->steps, perfect, motions, speed, cost, periods + w->steps);
  value += periods[w->steps].sensed[SENSE_OUT - 1];
  if (w->gradient) backward(w, net, first, motions, speed, cost, p, work, periods, g_motion);
  store(w, first, periods + w->steps, motions, &value);
}
