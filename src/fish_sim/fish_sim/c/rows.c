/* rows of a (batch, size) array into lanes and back; lanes past the end repeat the last row and are not written */
static inline void gather(const double *from, long size, long stride, long first, long batch, V *to)
{
  for (int l = 0; l < LANES; ++l) {
    const double *row = from + stride * (first + l < batch ? first + l : batch - 1);
    for (long k = 0; k < size; ++k) ((double *)to)[k * LANES + l] = row[k];
  }
}

static inline void scatter(const V *from, long size, long first, long batch, double *to)
{
  for (int l = 0; l < LANES && first + l < batch; ++l)
    for (long k = 0; k < size; ++k) to[(first + l) * size + k] = ((const double *)from)[k * LANES + l];
}
