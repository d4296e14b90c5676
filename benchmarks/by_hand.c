/* An extended Kalman filter of N states over a whole log, written by hand for one model: its
 * equations are the C code of CasADi (step and reading, included below), a step and a scalar
 * update per event as the compiled filter takes them, robust weight and likelihood included.  Rows
 * of x and P are kept at every event, and where there is room for them the model's outputs with their
 * variances; energies and gained information are not followed. */
#include <math.h>
#include <string.h>
#include "equations.c"

static double scratch[WORK];
static casadi_int counts[WHOLE];

static void predict(double *x, double (*P)[N], const double *u0, const double *u1, double dt,
                    const double *w, const double *p, const double *g, const double *q,
                    const double *noise) {
    double xn[N], F[N][N], Q[N][N], T[N][N]; /* F by columns, Q symmetric */
    const double *arg[GIVEN] = {x, u0, u1, &dt, w, p, g, q, noise};
    double *res[TAKEN] = {xn, &F[0][0], &Q[0][0]};
    model_step(arg, res, counts, scratch, 0);
    for (int j = 0; j < N; j++) { /* T = P Fᵀ: its row j by the rows of P, which is symmetric */
        double row[N] = {0};
        for (int k = 0; k < N; k++)
            for (int i = 0; i < N; i++) row[i] += F[k][j] * P[k][i];
        memcpy(T[j], row, sizeof row); /* T[j] = (F P)[j] */
    }
    for (int i = 0; i < N; i++) { /* P = T Fᵀ + Q */
        double row[N];
        memcpy(row, Q[i], sizeof row);
        for (int k = 0; k < N; k++)
            for (int j = 0; j < N; j++) row[j] += T[i][k] * F[k][j];
        memcpy(P[i], row, sizeof row);
    }
    memcpy(x, xn, sizeof xn);
}

static double update(double *x, double (*P)[N], int sensor, double z, double R, double limit,
                     const double *u, const double *w, const double *p, const double *g) {
    double h[M], H[N][M], PH[N], K[N], S = R; /* H by columns */
    const double *arg[GIVEN] = {x, u, w, p, g};
    double *res[TAKEN] = {h, &H[0][0]};
    model_reading(arg, res, counts, scratch, 0);
    memset(PH, 0, sizeof PH);
    for (int j = 0; j < N; j++)
        for (int i = 0; i < N; i++) PH[i] += P[j][i] * H[j][sensor];
    for (int i = 0; i < N; i++) S += H[i][sensor] * PH[i];
    double innovation = z - h[sensor], used = S;
    if (innovation * innovation > limit * limit * S) used = innovation * innovation / (limit * limit);
    for (int i = 0; i < N; i++) {
        K[i] = PH[i] / used;
        x[i] += K[i] * innovation;
    }
    for (int i = 0; i < N; i++) /* symmetric as it stands: the variance used is in the gain */
        for (int j = 0; j < N; j++) P[i][j] -= K[i] * PH[j];
    for (int c = 0; c < SCALES; c++) { /* factors keep their relative uncertainty */
        int i = scales[c];
        double before = x[i] - K[i] * innovation;
        double ratio = before > 0.0 && x[i] > 0.0 ? x[i] / before : 1.0;
        for (int j = 0; j < N; j++) P[i][j] *= ratio;
        for (int j = 0; j < N; j++) P[j][i] *= ratio;
    }
    return -0.5 * (log(2.0 * 3.14159265358979324 * used) + innovation * innovation / used);
}

static void outputs_at(const double *x, double (*P)[N], const double *u, const double *w,
                       const double *p, const double *g, const double *variance, double *rows) {
    double y[OUTPUTS], Y[N][OUTPUTS], Yu[INPUTS][OUTPUTS]; /* by columns, like F */
    const double *arg[GIVEN] = {x, u, w, p, g};
    double *res[TAKEN] = {y, &Y[0][0], &Yu[0][0]};
    model_outputs(arg, res, counts, scratch, 0);
    for (int o = 0; o < OUTPUTS; o++) {
        double total = 0.0;
        for (int i = 0; i < N; i++) {
            double sum = 0.0;
            for (int j = 0; j < N; j++) sum += P[i][j] * Y[j][o];
            total += Y[i][o] * sum;
        }
        for (int j = 0; j < INPUTS; j++) {
            double by = Yu[j][o];
            total += by * by * variance[j];
        }
        rows[2 * o] = y[o];
        rows[2 * o + 1] = total;
    }
}

double by_hand(long events, const double *t, const signed char *sensor, const double *z,
               const double *R, const double *u, const long *row, const double *W, const double *q,
               const double *longest, const double *noise, const double *p, const double *g,
               double limit, double *x, double *P, double *xs, double *Ps, const double *variance,
               double *ys) {
    double likelihood = 0.0, w[FLAGS + 1], held[DOUBTED + 1];
    for (int i = 0; i < DOUBTED; i++) held[i] = sqrt(P[doubted[i] * (N + 1)]);
    for (long k = 0; k < events; k++) {
        double span = k ? t[k] - t[k - 1] : 0.0;
        memcpy(w, W + row[k] * FLAGS, FLAGS * sizeof *w);
        for (int i = 0; span > 0.0 && i < DOUBTED; i++) w[FLAGS - DOUBTED + i] = held[i];
        if (span > 0.0) {
            int steps = (int)ceil(span / longest[row[k]]);
            for (int i = 0; i < steps; i++) {
                double u0[INPUTS], u1[INPUTS];
                for (int j = 0; j < INPUTS; j++) {
                    double from = u[(k - 1) * INPUTS + j], to = u[k * INPUTS + j];
                    u0[j] = from + (to - from) * i / steps;
                    u1[j] = from + (to - from) * (i + 1) / steps;
                }
                predict(x, (double(*)[N])P, u0, u1, span / steps, w, p, g, q + row[k] * 2 * N,
                        noise);
            }
        }
        if (sensor[k] >= 0) {
            likelihood += update(x, (double(*)[N])P, sensor[k], z[k], R[k], limit,
                                 u + k * INPUTS, w, p, g);
            for (int i = 0; i < DOUBTED; i++) held[i] = sqrt(P[doubted[i] * (N + 1)]);
        }
        memcpy(xs + k * N, x, N * sizeof *x);
        memcpy(Ps + k * N * N, P, N * N * sizeof *P);
        if (ys)
            outputs_at(x, (double(*)[N])P, u + k * INPUTS, w, p, g, variance, ys + k * 2 * OUTPUTS);
    }
    return likelihood;
}
