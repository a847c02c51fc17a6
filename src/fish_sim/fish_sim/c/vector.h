/* V and its elementary functions: a double (LANES 1) or a GCC vector of LANES doubles.
   Vector sine, cosine and exponential come from glibc's libmvec where it exists (LIBMVEC), else lane by lane. */
#include <math.h>

#if LANES == 1
typedef double V;
#define LANE(v, l) (v)
static inline V v_constant(double a) { return a; }
#else
typedef double V __attribute__((vector_size(8 * LANES)));
#define LANE(v, l) ((v)[l])
static inline V v_constant(double a) { return a - (V){0.0}; }
#endif

#define EACH(expression)                                     \
  {                                                          \
    V r = v_constant(0.0);                                   \
    for (int l = 0; l < LANES; ++l) LANE(r, l) = expression; \
    return r;                                                \
  }

#if LANES == 8 && defined(LIBMVEC)
V _ZGVeN8v_sin(V);
V _ZGVeN8v_cos(V);
V _ZGVeN8v_exp(V);
#define v_sin _ZGVeN8v_sin
#define v_cos _ZGVeN8v_cos
#define v_exp _ZGVeN8v_exp
#elif LANES == 4 && defined(LIBMVEC)
V _ZGVdN4v_sin(V);
V _ZGVdN4v_cos(V);
V _ZGVdN4v_exp(V);
#define v_sin _ZGVdN4v_sin
#define v_cos _ZGVdN4v_cos
#define v_exp _ZGVdN4v_exp
#else
static inline V v_sin(V a) EACH(sin(LANE(a, l)))
static inline V v_cos(V a) EACH(cos(LANE(a, l)))
static inline V v_exp(V a) EACH(exp(LANE(a, l)))
#endif

static inline V v_log(V a) EACH(log(LANE(a, l)))
static inline V v_tanh(V a) EACH(tanh(LANE(a, l)))
static inline V v_sqrt(V a) EACH(sqrt(LANE(a, l)))
static inline V v_fabs(V a) EACH(fabs(LANE(a, l)))
static inline V v_floor(V a) EACH(floor(LANE(a, l)))
static inline V v_sign(V a) EACH((double)((LANE(a, l) > 0) - (LANE(a, l) < 0)))
static inline V v_not(V a) EACH(LANE(a, l) == 0 ? 1.0 : 0.0)
static inline V v_atan2(V a, V b) EACH(atan2(LANE(a, l), LANE(b, l)))
static inline V v_pow(V a, V b) EACH(pow(LANE(a, l), LANE(b, l)))
static inline V v_fmin(V a, V b) EACH(LANE(a, l) < LANE(b, l) ? LANE(a, l) : LANE(b, l))
static inline V v_fmax(V a, V b) EACH(LANE(a, l) > LANE(b, l) ? LANE(a, l) : LANE(b, l))
static inline V v_lt(V a, V b) EACH(LANE(a, l) < LANE(b, l) ? 1.0 : 0.0)
static inline V v_le(V a, V b) EACH(LANE(a, l) <= LANE(b, l) ? 1.0 : 0.0)
static inline V v_eq(V a, V b) EACH(LANE(a, l) == LANE(b, l) ? 1.0 : 0.0)
static inline V v_ne(V a, V b) EACH(LANE(a, l) != LANE(b, l) ? 1.0 : 0.0)
static inline V v_and(V a, V b) EACH(LANE(a, l) != 0 && LANE(b, l) != 0 ? 1.0 : 0.0)
static inline V v_or(V a, V b) EACH(LANE(a, l) != 0 || LANE(b, l) != 0 ? 1.0 : 0.0)
static inline V v_if_else_zero(V a, V b) EACH(LANE(a, l) != 0 ? LANE(b, l) : 0.0)
