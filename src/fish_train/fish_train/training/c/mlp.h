/* Multilayer perceptron for LANES fish at once: weights are broadcast, each variable holds one value per fish.

   Weights are repacked once a call into panels of BLOCK outputs, so that the inner loop streams them: for a panel,
   panel[i * BLOCK + k] = W[o + k][i]. Sizes are padded to whole panels with zero weights. */

#include <stddef.h>

#define BLOCK 8
#define PAD(n) (((n) + BLOCK - 1) / BLOCK * BLOCK)

/* W: (n_out, n_in), row-major; transposed: panels of W^T instead */
static void pack(const double *W, long n_out, long n_in, int transposed, double *panels)
{
  const long rows = transposed ? n_in : n_out, columns = transposed ? n_out : n_in;
  for (long o = 0; o < PAD(rows); o += BLOCK)
    for (long i = 0; i < columns; ++i)
      for (long k = 0; k < BLOCK; ++k)
        *panels++ = o + k >= rows ? 0.0 : transposed ? W[i * n_in + o + k] : W[(o + k) * n_in + i];
}

/* out (PAD(n_out)) = W in + b; b may be NULL; in has n_in */
static void affine(const double *restrict panels, const double *b, long n_out, long n_in, const V *restrict in,
                   V *restrict out)
{
  for (long o = 0; o < n_out; o += BLOCK) {
    V a[BLOCK];
    for (int k = 0; k < BLOCK; ++k) a[k] = v_constant(b && o + k < n_out ? b[o + k] : 0.0);
    for (long i = 0; i < n_in; ++i, panels += BLOCK) {
      const V x = in[i];
      for (int k = 0; k < BLOCK; ++k) a[k] += v_constant(panels[k]) * x;
    }
    for (int k = 0; k < BLOCK; ++k) out[o + k] = a[k];
  }
}

static inline V v_positive(V a) EACH(LANE(a, l) > 0.0 ? LANE(a, l) : 0.0)
static inline V v_where_positive(V a, V b) EACH(LANE(a, l) > 0.0 ? LANE(b, l) : 0.0)
