/* Where a fish is on its path: the search of fish_control.path_batch.PathBatch for one fish.

   A path is a table of rows x, y, heading, curvature, chord. Nothing here is differentiated: the result says which
   samples are nearest and ahead; the emitted `sense` does the rest. */

#define ROW 5
#define NG 15 /* GEOMETRY_NAMES of closed_loop_equations.py */

typedef struct {
  const double *table; /* (rows, ROW) */
  double spacing, lap_end;
  long count, last; /* samples of one lap, last row */
  int closed, restarts;
} Path;

typedef struct { double progress, captured; } Place;

typedef struct { double search_window, lookahead, lookahead_search, capture_distance; } Search;

static inline const double *row_at(const Path *path, double s)
{
  long k = (long)rint(s / path->spacing);
  k = path->closed ? k % path->count : k < path->last ? k : path->last;
  return path->table + k * ROW;
}

static inline double distance_squared(const double *row, double x, double y)
{
  return (row[0] - x) * (row[0] - x) + (row[1] - y) * (row[1] - y);
}

/* nearest of the samples in the window ahead of s0: its arc length and squared distance */
static double nearest(const Path *path, const Search *search, double s0, double x, double y, double *squared)
{
  const long samples = (long)ceil(search->search_window / path->spacing) + 1;
  double best = s0, least = INFINITY;
  for (long i = 0; i < samples; ++i) {
    double s = s0 + i * path->spacing;
    if (s > path->lap_end) s = path->lap_end;
    const double d = distance_squared(row_at(path, s), x, y);
    if (d < least) least = d, best = s;
    if (s == path->lap_end) break;
  }
  *squared = least;
  return best;
}

/* rows of the segment on which the path ahead of s leaves the circle about (x, y); the farthest point if it stays.
   A sample at distance d cannot be followed by one outside within (L - d) / spacing samples: those are skipped. */
static void lookahead_segment(const Path *path, const Search *search, double s, double x, double y, const double **a,
                              const double **b)
{
  const double L = search->lookahead;
  const long samples = (long)ceil(search->lookahead_search * L / path->spacing) + 1;
  long i = 0, farthest = 0;
  double most = -1.0;
  while (i < samples) {
    const double d = sqrt(distance_squared(row_at(path, s + i * path->spacing), x, y));
    if (d > most) most = d, farthest = i;
    if (d >= L) break;
    const long skip = (long)((L - d) / path->spacing * 0.999);
    i += skip > 1 ? skip : 1;
  }
  if (i >= samples) { /* no sample leaves: look at every one for the farthest */
    most = -1.0;
    for (long j = 0; j < samples; ++j) {
      const double d = distance_squared(row_at(path, s + j * path->spacing), x, y);
      if (d > most) most = d, farthest = j;
    }
    i = farthest;
  }
  *b = row_at(path, s + i * path->spacing);
  *a = row_at(path, s + (i > 0 ? i - 1 : 0) * path->spacing);
}

/* NaN gives low: a fish that is nowhere stays where it was on the path */
static inline double clip(double v, double low, double high) { return v > low ? v < high ? v : high : low; }

/* advance the place and fill the geometry g (NG values, `stride` apart) */
static void locate(const Path *path, const Search *search, Place *place, double x, double y, double *g, long stride)
{
  double s0 = place->progress, squared;
  if (path->restarts && s0 >= path->lap_end - 1e-6) s0 = 0.0, place->captured = 0.0;
  double base = nearest(path, search, s0, x, y, &squared);
  if (squared <= search->capture_distance * search->capture_distance) place->captured = 1.0;
  double lowest = s0 - base, highest = path->lap_end - base;
  if (lowest < -path->spacing) lowest = -path->spacing;
  if (highest > path->spacing) highest = path->spacing;
  if (place->captured == 0.0) base = s0, lowest = highest = 0.0;
  const double *r = row_at(path, base);
  const double delta = base - rint(base / path->spacing) * path->spacing;
  const double mean = r[2] + 0.5 * r[3] * delta, heading = r[2] + r[3] * delta;
  const double bx = r[0] + delta * cos(mean), by = r[1] + delta * sin(mean);
  const double along = cos(heading) * (x - bx) + sin(heading) * (y - by);
  place->progress = base + clip(along, lowest, highest);
  const double *row = row_at(path, place->progress), *a, *b;
  lookahead_segment(path, search, place->progress, x, y, &a, &b);
  const double values[NG] = {
    bx, by, heading, lowest, highest, row[0], row[1], row[2], row[3], row[4],
    base - rint(place->progress / path->spacing) * path->spacing, a[0], a[1], b[0], b[1],
  };
  for (int k = 0; k < NG; ++k) g[k * stride] = values[k];
}
