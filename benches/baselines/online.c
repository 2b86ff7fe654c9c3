/*
 * The three schemes of Reyes and Kelly (1997) for their two-link arm in plain C: the yardstick of the benchmarks.
 *
 * What a controls engineer would write by hand for this one arm: fixed sizes, the sample period known beforehand and its filter
 * coefficients computed once, least squares by equation (21) as it is printed, on the full matrix, in a form that rounding keeps
 * symmetric and that compilers vectorize. No checks of the input. `exact` selects the consistent filters of
 * docs/decisions/007-exact-filters.md instead of the paper's.
 */
#include "online.h"

#include <math.h>
#include <string.h>

#define R BASELINE_PARAMETERS

static struct baseline_step step_of(double lambda, double h)
{
	double x = lambda * h, a = exp(-x), mean = (1 - a) / x;
	struct baseline_step s = {a, mean - a, 1 - mean, 4 / x * (1 - 2 / x + a * (1 + 2 / x)), lambda};
	return s;
}

static double sgn(double x)
{
	return (x > 0) - (x < 0);
}

/* ---- regressors of the arm: momentum, the rest without friction, energy; joint 1's entries first ---- */

static void momentum_rows(const double *q, const double *dq, double rows[2][R])
{
	double c2 = cos(q[1]);
	memset(rows, 0, 2 * R * sizeof(double));
	rows[0][0] = dq[0];
	rows[0][1] = c2 * (2 * dq[0] + dq[1]);
	rows[0][2] = dq[1];
	rows[1][1] = c2 * dq[0];
	rows[1][2] = dq[0] + dq[1];
}

static void potential_rows(const double *q, const double *dq, double rows[2][R])
{
	double outer = sin(q[0] + q[1]);
	memset(rows, 0, 2 * R * sizeof(double));
	rows[0][3] = sin(q[0]);
	rows[0][4] = outer;
	rows[1][1] = sin(q[1]) * dq[0] * (dq[0] + dq[1]);
	rows[1][4] = outer;
}

static void add_friction(const double *dq, double rows[2][R])
{
	rows[0][5] += dq[0];
	rows[1][6] += dq[1];
	rows[0][7] += sgn(dq[0]);
	rows[1][8] += sgn(dq[1]);
}

static void energy_row(const double *q, const double *dq, double row[R])
{
	memset(row, 0, R * sizeof(double));
	row[0] = 0.5 * dq[0] * dq[0];
	row[1] = cos(q[1]) * dq[0] * (dq[0] + dq[1]);
	row[2] = dq[1] * (dq[0] + 0.5 * dq[1]);
	row[3] = 1 - cos(q[0]);
	row[4] = 1 - cos(q[0] + q[1]);
}

static void power_row(const double *dq, double row[R])
{
	memset(row, 0, R * sizeof(double));
	row[5] = dq[0] * dq[0];
	row[6] = dq[1] * dq[1];
	row[7] = fabs(dq[0]);
	row[8] = fabs(dq[1]);
}

/* ---- recursive least squares, equations (20) to (22), one row ---- */

static void learn(struct baseline *p, const double psi[R], double y, double error_variance)
{
	double g[R] = {0}, s = error_variance, e = y;
	for (int j = 0; j < R; j++)
		for (int i = 0; i < R; i++)
			g[i] += p->P[j][i] * psi[j];
	for (int i = 0; i < R; i++) {
		s += psi[i] * g[i];
		e -= psi[i] * p->theta[i];
	}
	double scale = 1 / s;
	for (int i = 0; i < R; i++)
		p->theta[i] += g[i] * (e * scale);
	for (int j = 0; j < R; j++)
		for (int i = 0; i < R; i++)
			p->P[j][i] -= g[i] * g[j] * scale;
}

static void forget(struct baseline *p)
{
	if (p->forgetting == 1)
		return;
	double grow = 1 / p->forgetting;
	for (int j = 0; j < R; j++)
		for (int i = 0; i < R; i++)
			p->P[j][i] *= grow;
}

/* ---- filters ---- */

static void low_ramp(const struct baseline_step *s, double *y, const double *from, const double *to, int n)
{
	for (int i = 0; i < n; i++)
		y[i] = s->decay * y[i] + s->first * from[i] + s->last * to[i];
}

/* ---- friction over an interval in which the joint may turn round, velocity linear ---- */

static int turns(double from, double to)
{
	return (from > 0 && to < 0) || (from < 0 && to > 0);
}

/* What the sign adds to its filter. */
static double sign_step(const struct baseline_step *s, double x, double from, double to)
{
	double end = 1;
	if (!turns(from, to))
		return sgn(from + to) * (1 - s->decay);
	end = exp(-x * (to / (to - from)));
	return sgn(from) * (2 * end - 1 - s->decay);
}

static double speed(const struct baseline_step *s, double x, double y, double from, double to)
{
	if (!turns(from, to))
		return s->decay * y + s->first * fabs(from) + s->last * fabs(to);
	return s->decay * (y - fabs(from)) + fabs(to) - (to - from) / x * sign_step(s, x, from, to);
}

static double square(const struct baseline_step *s, double y, double from, double to)
{
	double change = to - from;
	return s->decay * y + s->first * from * from + s->last * to * to - s->bulge * 0.25 * change * change;
}

/* ---- filtered dynamic model, equation (24) ---- */

static void dynamic_start(struct baseline *p, const double *q, const double *dq, const double *tau)
{
	double potential[2][R];
	momentum_rows(q, dq, p->derivative_in);
	potential_rows(q, dq, potential);
	memcpy(p->potential, potential, sizeof potential);
	add_friction(dq, potential);
	memcpy(p->rest_in, potential, sizeof potential);
	memset(p->derivative, 0, sizeof p->derivative);
	memset(p->rest, 0, sizeof p->rest);
	if (p->exact)
		memcpy(p->derivative, p->derivative_in, sizeof p->derivative);
	memcpy(p->supply_in, tau, sizeof p->supply_in);
	memset(p->supply, 0, sizeof p->supply);
}

static void dynamic_paper(struct baseline *p, const double *q, const double *dq, const double *tau)
{
	const struct baseline_step *s = &p->whole;
	double momentum[2][R], rest[2][R], psi[2][R], y[2];
	momentum_rows(q, dq, momentum);
	potential_rows(q, dq, rest);
	add_friction(dq, rest);
	for (int i = 0; i < 2; i++) {
		for (int j = 0; j < R; j++) {
			p->derivative[i][j] = s->decay * p->derivative[i][j] + s->lambda * (momentum[i][j] - p->derivative_in[i][j]);
			p->rest[i][j] = s->decay * p->rest[i][j] + (1 - s->decay) * p->rest_in[i][j];
			psi[i][j] = p->derivative[i][j] + p->rest[i][j];
		}
		y[i] = p->supply[i] = s->decay * p->supply[i] + (1 - s->decay) * p->supply_in[i];
	}
	memcpy(p->derivative_in, momentum, sizeof momentum);
	memcpy(p->rest_in, rest, sizeof rest);
	memcpy(p->supply_in, tau, sizeof p->supply_in);
	learn(p, psi[0], y[0], p->forgetting);
	learn(p, psi[1], y[1], p->forgetting);
	forget(p);
}

static void dynamic_exact(struct baseline *p, const double *q, const double *dq, const double *before, const double *now)
{
	const struct baseline_step *s = &p->whole;
	double momentum[2][R], potential[2][R], psi[2][R], y[2], x = s->lambda * p->h;
	momentum_rows(q, dq, momentum);
	potential_rows(q, dq, potential);
	low_ramp(s, &p->rest[0][0], &p->potential[0][0], &potential[0][0], 2 * R);
	low_ramp(s, &p->derivative[0][0], &p->derivative_in[0][0], &momentum[0][0], 2 * R);
	for (int i = 0; i < 2; i++) {
		p->viscous[i] = s->decay * p->viscous[i] + s->first * p->last_dq[i] + s->last * dq[i];
		p->coulomb[i] = s->decay * p->coulomb[i] + sign_step(s, x, p->last_dq[i], dq[i]);
		for (int j = 0; j < R; j++)
			psi[i][j] = s->lambda * (momentum[i][j] - p->derivative[i][j]) + p->rest[i][j];
		psi[i][5 + i] += p->viscous[i];
		psi[i][7 + i] += p->coulomb[i];
		p->supply[i] = p->half.decay * p->supply[i] + (1 - p->half.decay) * before[i];
		y[i] = p->supply[i] = p->half.decay * p->supply[i] + (1 - p->half.decay) * now[i];
	}
	memcpy(p->derivative_in, momentum, sizeof momentum);
	memcpy(p->potential, potential, sizeof potential);
	learn(p, psi[0], y[0], p->forgetting);
	learn(p, psi[1], y[1], p->forgetting);
	forget(p);
}

/* ---- supplied energy model, equation (28) ---- */

static void energy_start(struct baseline *p, const double *q, const double *dq, const double *tau)
{
	energy_row(q, dq, p->derivative_in[0]);
	memset(p->rest, 0, sizeof p->rest);
	p->supply[0] = 0;
	p->supply_in[0] = tau[0] * dq[0] + tau[1] * dq[1];
}

static void energy_update(struct baseline *p, const double *q, const double *dq, const double *tau, const double *before, const double *middle)
{
	double energy[R], psi[R], half = 0.5 * p->h;
	if (p->exact) {
		for (int i = 0; i < 2; i++) {
			double from = p->last_dq[i], to = dq[i], sum = fabs(from) + fabs(to);
			p->rest[0][5 + i] += p->h / 3 * (from * from + from * to + to * to);
			p->rest[0][7 + i] += half * (turns(from, to) ? (from * from + to * to) / sum : sum);
		}
		for (int i = 0; i < 2; i++)
			p->supply[0] += before[i] * (middle[i] - p->state_q[i]) + tau[i] * (q[i] - middle[i]);
	} else {
		double a[R], b[R], supplied = tau[0] * dq[0] + tau[1] * dq[1];
		power_row(p->last_dq, a);
		power_row(dq, b);
		for (int j = 0; j < R; j++)
			p->rest[0][j] += (a[j] + b[j]) * half;
		p->supply[0] += (p->supply_in[0] + supplied) * half;
		p->supply_in[0] = supplied;
	}
	energy_row(q, dq, energy);
	for (int j = 0; j < R; j++)
		psi[j] = energy[j] - p->derivative_in[0][j] + p->rest[0][j];
	learn(p, psi, p->supply[0], p->forgetting);
	forget(p);
}

/* ---- filtered power model, equation (30) ---- */

static void power_start(struct baseline *p, const double *q, const double *dq, const double *tau)
{
	energy_row(q, dq, p->derivative_in[0]);
	power_row(dq, p->rest_in[0]);
	memset(p->derivative, 0, sizeof p->derivative);
	memset(p->rest, 0, sizeof p->rest);
	if (p->exact)
		memcpy(p->derivative[0], p->derivative_in[0], sizeof p->derivative[0]);
	p->supply[0] = 0;
	p->supply_in[0] = tau[0] * dq[0] + tau[1] * dq[1];
}

static void power_paper(struct baseline *p, const double *q, const double *dq, const double *tau)
{
	const struct baseline_step *s = &p->whole;
	double energy[R], power[R], psi[R];
	energy_row(q, dq, energy);
	power_row(dq, power);
	for (int j = 0; j < R; j++) {
		p->derivative[0][j] = s->decay * p->derivative[0][j] + s->lambda * (energy[j] - p->derivative_in[0][j]);
		p->rest[0][j] = s->decay * p->rest[0][j] + (1 - s->decay) * p->rest_in[0][j];
		psi[j] = p->derivative[0][j] + p->rest[0][j];
	}
	memcpy(p->derivative_in[0], energy, sizeof energy);
	memcpy(p->rest_in[0], power, sizeof power);
	p->supply[0] = s->decay * p->supply[0] + (1 - s->decay) * p->supply_in[0];
	p->supply_in[0] = tau[0] * dq[0] + tau[1] * dq[1];
	learn(p, psi, p->supply[0], p->forgetting);
	forget(p);
}

static void power_exact(struct baseline *p, const double *q, const double *dq, const double *before, const double *now)
{
	const struct baseline_step *s = &p->whole;
	double energy[R], middle[R], psi[R], half_q[2], half_dq[2];
	for (int i = 0; i < 2; i++) {
		half_q[i] = 0.5 * (p->state_q[i] + q[i]) - (dq[i] - p->last_dq[i]) * (0.125 * p->h);
		half_dq[i] = 0.5 * (p->last_dq[i] + dq[i]);
	}
	energy_row(q, dq, energy);
	energy_row(half_q, half_dq, middle);
	for (int i = 0; i < 2; i++) {
		p->rest[0][5 + i] = square(s, p->rest[0][5 + i], p->last_dq[i], dq[i]);
		p->rest[0][7 + i] = speed(s, s->lambda * p->h, p->rest[0][7 + i], p->last_dq[i], dq[i]);
	}
	for (int j = 0; j < R; j++) {
		double height = middle[j] - 0.5 * (energy[j] + p->derivative_in[0][j]);
		p->derivative[0][j] = s->decay * p->derivative[0][j] + s->first * p->derivative_in[0][j] + s->last * energy[j] + s->bulge * height;
		psi[j] = s->lambda * (energy[j] - p->derivative[0][j]) + p->rest[0][j];
	}
	memcpy(p->derivative_in[0], energy, sizeof energy);
	double first[2] = {before[0] * p->last_dq[0] + before[1] * p->last_dq[1], before[0] * half_dq[0] + before[1] * half_dq[1]};
	double second[2] = {now[0] * half_dq[0] + now[1] * half_dq[1], now[0] * dq[0] + now[1] * dq[1]};
	low_ramp(&p->half, p->supply, &first[0], &first[1], 1);
	low_ramp(&p->half, p->supply, &second[0], &second[1], 1);
	learn(p, psi, p->supply[0], p->forgetting);
	forget(p);
}

/* ---- one sample in ---- */

void baseline_start(struct baseline *p, enum baseline_scheme scheme, int exact, double h, double cutoff, double p0, double forgetting)
{
	memset(p, 0, sizeof *p);
	p->scheme = scheme;
	p->exact = exact;
	p->h = h;
	p->forgetting = forgetting;
	p->whole = step_of(cutoff, h);
	p->half = step_of(cutoff, 0.5 * h);
	for (int i = 0; i < R; i++)
		p->P[i][i] = p0;
}

static void begin(struct baseline *p, const double *q, const double *dq, const double *tau)
{
	if (p->scheme == BASELINE_DYNAMIC)
		dynamic_start(p, q, dq, tau);
	else if (p->scheme == BASELINE_ENERGY)
		energy_start(p, q, dq, tau);
	else
		power_start(p, q, dq, tau);
}

static void regress(struct baseline *p, const double *q, const double *dq, const double *tau, const double *before, const double *middle)
{
	if (p->scheme == BASELINE_ENERGY)
		energy_update(p, q, dq, tau, before, middle);
	else if (p->scheme == BASELINE_DYNAMIC && p->exact)
		dynamic_exact(p, q, dq, before, tau);
	else if (p->scheme == BASELINE_DYNAMIC)
		dynamic_paper(p, q, dq, tau);
	else if (p->exact)
		power_exact(p, q, dq, before, tau);
	else
		power_paper(p, q, dq, tau);
}

void baseline_update(struct baseline *p, const double q[2], const double tau[2])
{
	double at[2], dq[2] = {0, 0};
	for (int i = 0; i < 2; i++) {
		at[i] = p->exact ? 0.5 * (p->q[i] + q[i]) : q[i];
		if (p->samples > 0)
			dq[i] = (q[i] - p->q[i]) / p->h;
	}
	const double *torque = p->exact ? p->tau : tau;
	if (p->samples == p->exact)
		begin(p, at, dq, torque);
	else if (p->samples > p->exact)
		regress(p, at, dq, torque, p->tau_before, p->q);
	memcpy(p->state_q, at, sizeof at);
	memcpy(p->last_dq, dq, sizeof dq);
	memcpy(p->tau_before, p->tau, sizeof p->tau);
	memcpy(p->q, q, sizeof p->q);
	memcpy(p->tau, tau, sizeof p->tau);
	p->samples++;
}

long baseline_size(void)
{
	return sizeof(struct baseline);
}

void baseline_run(struct baseline *p, const double *q, const double *tau, long samples)
{
	for (long k = 0; k < samples; k++)
		baseline_update(p, q + 2 * k, tau + 2 * k);
}
