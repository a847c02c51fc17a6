/* V and its elementary functions: a double (LANES 1) or a GCC vector of LANES doubles.
   Sine and cosine are polynomials for all lanes at once (absolute error 2e-16 up to 200 rad); the exponential comes
   from glibc's libmvec where it exists (LIBMVEC), else lane by lane. */
#include <math.h>

/* the functions below are one long block without branches: schedule it before registers run out (5 % faster) */
#pragma GCC optimize ("schedule-insns", "sched-pressure")

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

#if LANES == 1
typedef long long VI;
typedef unsigned long long VU;
#else
typedef long long VI __attribute__((vector_size(8 * LANES)));
typedef unsigned long long VU __attribute__((vector_size(8 * LANES)));
#endif
static inline VI v_bits(V a) { union { V v; VI i; } u; u.v = a; return u.i; }
static inline V v_of_bits(VI a) { union { V v; VI i; } u; u.i = a; return u.v; }

/* sine and cosine share the reduction to |r| <= pi/4 (Cody and Waite) and the two polynomials (minimax, those of
   fdlibm, error below 1 ulp); the compiler finds the common part when both are asked for */
static inline V v_reduce(V a, VI *quadrant)
{
  const V magic = v_constant(0x1.8p52);
  V t = a * v_constant(0x1.45f306dc9c883p-1) + magic, n = t - magic;
  *quadrant = v_bits(t);
  V r = a - n * v_constant(0x1.921fb54442d18p+0);
  return r - n * v_constant(0x1.1a62633145c07p-54);
}
static inline V v_sin_poly(V r)
{
  V z = r * r;
  V p = v_constant(1.58969099521155010221e-10);
  p = p * z + v_constant(-2.50507602534068634195e-08);
  p = p * z + v_constant(2.75573137070700676789e-06);
  p = p * z + v_constant(-1.98412698298579493134e-04);
  p = p * z + v_constant(8.33333333332248946124e-03);
  p = p * z + v_constant(-1.66666666666666324348e-01);
  return r + r * z * p;
}
static inline V v_cos_poly(V r)
{
  V z = r * r;
  V p = v_constant(-1.13596475577881948265e-11);
  p = p * z + v_constant(2.08757232129817482790e-09);
  p = p * z + v_constant(-2.75573143513906633035e-07);
  p = p * z + v_constant(2.48015872894767294178e-05);
  p = p * z + v_constant(-1.38888888888741095749e-03);
  p = p * z + v_constant(4.16666666666666019037e-02);
  return (v_constant(1.0) - v_constant(0.5) * z) + z * z * p;
}
static inline V v_quadrant(VI k, V even, V odd)
{
  VI swap = -(k & 1);
  VI value = (v_bits(even) & ~swap) | (v_bits(odd) & swap);
  return v_of_bits(value ^ (VI)((VU)(k & 2) << 62)); /* the sign bit, which a signed shift may not reach */
}
static inline V v_sin(V a)
{
  VI k;
  V r = v_reduce(a, &k);
  return v_quadrant(k, v_sin_poly(r), v_cos_poly(r));
}
static inline V v_cos(V a)
{
  VI k;
  V r = v_reduce(a, &k);
  return v_quadrant(k + 1, v_sin_poly(r), v_cos_poly(r));
}

#if LANES == 8 && defined(LIBMVEC)
V _ZGVeN8v_exp(V);
#define v_exp _ZGVeN8v_exp
#elif LANES == 4 && defined(LIBMVEC)
V _ZGVdN4v_exp(V);
#define v_exp _ZGVdN4v_exp
#else
static inline V v_exp(V a) EACH(exp(LANE(a, l)))
#endif

static inline V v_log(V a) EACH(log(LANE(a, l)))
static inline V v_tanh(V a) EACH(tanh(LANE(a, l)))
static inline V v_sqrt(V a) EACH(sqrt(LANE(a, l)))
static inline V v_floor(V a) EACH(floor(LANE(a, l)))
static inline V v_atan2(V a, V b) EACH(atan2(LANE(a, l), LANE(b, l)))
static inline V v_pow(V a, V b) EACH(pow(LANE(a, l), LANE(b, l)))

/* comparisons and selections: C's ?: does not take vectors, masks do */
#if LANES == 1
static inline V v_fabs(V a) { return fabs(a); }
static inline V v_fmin(V a, V b) { return a < b ? a : b; }
static inline V v_fmax(V a, V b) { return a > b ? a : b; }
static inline V v_lt(V a, V b) { return a < b; }
static inline V v_le(V a, V b) { return a <= b; }
static inline V v_eq(V a, V b) { return a == b; }
static inline V v_ne(V a, V b) { return a != b; }
static inline V v_not(V a) { return a == 0.0; }
static inline V v_if_else_zero(V a, V b) { return a != 0.0 ? b : 0.0; }
#else
typedef long long M __attribute__((vector_size(8 * LANES)));
static inline V v_select(M m, V a, V b) { return (V)((m & (M)a) | (~m & (M)b)); }
static inline V v_where(M m, V a) { return (V)(m & (M)a); }
static inline V v_fabs(V a) { return v_select(a < v_constant(0.0), -a, a); }
static inline V v_fmin(V a, V b) { return v_select(a < b, a, b); }
static inline V v_fmax(V a, V b) { return v_select(a > b, a, b); }
static inline V v_lt(V a, V b) { return v_where(a < b, v_constant(1.0)); }
static inline V v_le(V a, V b) { return v_where(a <= b, v_constant(1.0)); }
static inline V v_eq(V a, V b) { return v_where(a == b, v_constant(1.0)); }
static inline V v_ne(V a, V b) { return v_where(a != b, v_constant(1.0)); }
static inline V v_not(V a) { return v_where(a == v_constant(0.0), v_constant(1.0)); }
static inline V v_if_else_zero(V a, V b) { return v_where(a != v_constant(0.0), b); }
#endif
static inline V v_and(V a, V b) { return v_if_else_zero(a, v_ne(b, v_constant(0.0))); }
static inline V v_or(V a, V b) { return v_fmax(v_ne(a, v_constant(0.0)), v_ne(b, v_constant(0.0))); }
static inline V v_sign(V a) { return v_lt(v_constant(0.0), a) - v_lt(a, v_constant(0.0)); }
