/* A solver for graybox in plain C, without any library: the multiplicative algorithm.
 *
 *   cc -O2 scripts/examples/external_solver.c -lm -o external_solver
 *   graybox solve set.h5 --solver "external:./external_solver {npy}" --gap 1e-3
 *
 * The set comes as NumPy's .npy: ten bytes, a text with "'shape': (Q, p)", then Q p doubles, the
 * lower triangles row by row. This reads it on little-endian machines, which is what it is made for.
 */
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

static void fail(const char *words) {
  fprintf(stderr, "%s\n", words);
  exit(1);
}

static double *zeros(size_t count) {
  double *array = calloc(count, sizeof *array);
  if (array == NULL) fail("not enough memory");
  return array;
}

static double now(void) {
  struct timespec time;
  timespec_get(&time, TIME_UTC);
  return (double)time.tv_sec + 1e-9 * (double)time.tv_nsec;
}

static double *read_npy(const char *path, size_t *candidates, size_t *packed) {
  unsigned char start[10];
  char text[65536];
  FILE *file = fopen(path, "rb");
  if (file == NULL) fail("the set can't be opened");
  if (fread(start, 1, sizeof start, file) != sizeof start || memcmp(start, "\x93NUMPY\x01", 7) != 0)
    fail("the set is no .npy of version 1");
  const size_t length = start[8] + 256u * start[9];
  if (fread(text, 1, length, file) != length) fail("the set is cut off");
  text[length < sizeof text ? length : sizeof text - 1] = '\0';
  const char *shape = strstr(text, "'shape': (");
  if (shape == NULL || sscanf(shape, "'shape': (%zu, %zu)", candidates, packed) != 2)
    fail("the set has no shape of two numbers");
  double *values = zeros(*candidates * *packed);
  if (fread(values, sizeof *values, *candidates * *packed, file) != *candidates * *packed)
    fail("the set is cut off");
  fclose(file);
  return values;
}

/* The inverse of the symmetric positive definite d x d matrix, by the Cholesky factor M = L L'. */
static void invert(size_t d, const double *matrix, double *inverse) {
  double *factor = zeros(d * d), *column = zeros(d);
  for (size_t i = 0; i < d; ++i) {
    for (size_t j = 0; j <= i; ++j) {
      double sum = matrix[i * d + j];
      for (size_t k = 0; k < j; ++k) sum -= factor[i * d + k] * factor[j * d + k];
      if (i == j && !(sum > 0.0)) fail("the information matrix is singular");
      factor[i * d + j] = i == j ? sqrt(sum) : sum / factor[j * d + j];
    }
  }
  for (size_t c = 0; c < d; ++c) {
    for (size_t i = 0; i < d; ++i) {
      double sum = i == c ? 1.0 : 0.0;
      for (size_t k = 0; k < i; ++k) sum -= factor[i * d + k] * column[k];
      column[i] = sum / factor[i * d + i];
    }
    for (size_t i = d; i-- > 0;) {
      double sum = column[i];
      for (size_t k = i + 1; k < d; ++k) sum -= factor[k * d + i] * column[k];
      column[i] = sum / factor[i * d + i];
    }
    for (size_t i = 0; i < d; ++i) inverse[i * d + c] = column[i];
  }
  free(factor);
  free(column);
}

/* w_i = tr(M^-1 H_i) of all candidates; returns the largest. */
static double sensitivities(size_t candidates, size_t d, const double *set, const double *weights,
                            double *sensitivity) {
  const size_t packed = d * (d + 1) / 2;
  double *matrix = zeros(d * d), *inverse = zeros(d * d), largest = 0.0;
  for (size_t q = 0; q < candidates; ++q) {
    const double *entry = set + q * packed;
    for (size_t i = 0; i < d; ++i)
      for (size_t j = 0; j <= i; ++j) matrix[i * d + j] += weights[q] * *entry++;
  }
  invert(d, matrix, inverse);
  for (size_t q = 0; q < candidates; ++q) {
    const double *entry = set + q * packed;
    double sum = 0.0;
    for (size_t i = 0; i < d; ++i)
      for (size_t j = 0; j <= i; ++j) sum += (i == j ? 1.0 : 2.0) * inverse[i * d + j] * *entry++;
    sensitivity[q] = sum;
    if (sum > largest) largest = sum;
  }
  free(matrix);
  free(inverse);
  return largest;
}

static void write_design(const char *path, size_t candidates, const double *weights, int solved,
                         double seconds) {
  FILE *file = fopen(path, "w");
  const char *separator = "";
  if (file == NULL) fail("the design can't be written");
  fprintf(file, "{\"format\": \"graybox-design/1\", \"solver\": \"external_solver.c\",\n");
  fprintf(file, " \"status\": \"%s\", \"seconds\": %g,\n", solved ? "solved" : "time_limit",
          seconds);
  fprintf(file, " \"support\": [");
  for (size_t q = 0; q < candidates; ++q) {
    if (weights[q] == 0.0) continue;
    fprintf(file, "%s\n  {\"index\": %zu, \"weight\": %.17g}", separator, q, weights[q]);
    separator = ",";
  }
  fprintf(file, "]}\n");
  if (fclose(file) != 0) fail("the design can't be written");
}

int main(int count, char **arguments) {
  if (count != 5) fail("usage: external_solver problem.npy design.json GAP SECONDS");
  size_t candidates = 0, packed = 0, d = 1;
  double *set = read_npy(arguments[1], &candidates, &packed);
  while (d * (d + 1) / 2 < packed) ++d;
  const double gap = atof(arguments[3]), seconds = atof(arguments[4]), start = now();
  double *weights = zeros(candidates), *sensitivity = zeros(candidates);
  for (size_t q = 0; q < candidates; ++q) weights[q] = 1.0 / (double)candidates;
  int solved = 0;
  for (;;) {
    const double largest = sensitivities(candidates, d, set, weights, sensitivity);
    double sum = 0.0;
    solved = largest / (double)d - 1.0 <= gap;
    if (solved || now() - start > 0.9 * seconds) break;
    for (size_t q = 0; q < candidates; ++q) sum += weights[q] *= sensitivity[q] / (double)d;
    for (size_t q = 0; q < candidates; ++q) weights[q] /= sum;
  }
  write_design(arguments[2], candidates, weights, solved, now() - start);
  free(set);
  free(weights);
  free(sensitivity);
  return 0;
}
