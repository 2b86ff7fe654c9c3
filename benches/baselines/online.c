/*
 * The three schemes of Reyes and Kelly (1997) for their two-link arm in plain C: the yardstick of the benchmarks.
 *
 * What a controls engineer would write by hand for this one arm, as lean as it can be: the sample period known beforehand and everything
 * that depends on it computed once, sines and cosines of two angles only, no entry of a regressor that is always zero filtered, least
 * squares by equation (21) on the full matrix, in a form that rounding keeps symmetric and that compilers vectorize (the upper triangle
 * alone takes as long, and longer with wide vectors), and a loop of its own for each scheme and pair of filters, into which all of it is
 * inlined. No checks of the input. `exact` selects the consistent filters of docs/decisions/007-exact-filters.md instead of the paper's.
 */
#include "online.h"

#include <math.h>
#include <string.h>

#define R BASELINE_PARAMETERS
#define INLINE static inline __attribute__((always_inline))

static struct baseline_step step_of(double lambda, double h)
{
	double x = lambda * h, a = exp(-x), mean = (1 - a) / x;
	struct baseline_step s = {a, 1 - a, mean - a, 1 - mean, 4 / x * (1 - 2 / x + a * (1 + 2 / x)), lambda};
	return s;
}

static double sgn(double x)
{
	return (x > 0) - (x < 0);
}

/* ---- regressors of the arm, their entries that are not always zero ---- */

/* Momentum: columns 0, 1, 2 of joint 1, columns 1, 2 of joint 2; the rest without friction: columns 3, 4 of joint 1 (4 of joint 2 is the
 * same), column 1 of joint 2. */
INLINE void torque_entries(const double *q, const double *dq, double momentum[5], double rest[3])
{
	double s1 = sin(q[0]), c1 = cos(q[0]), s2 = sin(q[1]), c2 = cos(q[1]), sum = dq[0] + dq[1];
	momentum[0] = dq[0];
	momentum[1] = c2 * (dq[0] + sum);
	momentum[2] = dq[1];
	momentum[3] = c2 * dq[0];
	momentum[4] = sum;
	rest[0] = s1;
	rest[1] = s1 * c2 + c1 * s2;
	rest[2] = s2 * dq[0] * sum;
}

/* Columns 0 to 4. */
INLINE void energy_entries(const double *q, const double *dq, double e[5])
{
	double s1 = sin(q[0]), c1 = cos(q[0]), s2 = sin(q[1]), c2 = cos(q[1]);
	e[0] = 0.5 * dq[0] * dq[0];
	e[1] = c2 * dq[0] * (dq[0] + dq[1]);
	e[2] = dq[1] * (dq[0] + 0.5 * dq[1]);
	e[3] = 1 - c1;
	e[4] = 1 - (c1 * c2 - s1 * s2);
}

/* Columns 5 to 8. */
INLINE void power_entries(const double *dq, double w[4])
{
	w[0] = dq[0] * dq[0];
	w[1] = dq[1] * dq[1];
	w[2] = fabs(dq[0]);
	w[3] = fabs(dq[1]);
}

/* ---- recursive least squares, equations (20) to (22) ---- */

INLINE void learn(struct baseline *p, const double psi[R], double y)
{
	double g[R] = {0}, s = p->forgetting, e = y;
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

/* Two rows: one after the other, or, with wide vectors, in one pass over the matrix. */
INLINE void learn_both(struct baseline *p, const double a[R], const double b[R], double ya, double yb)
{
#ifndef __AVX2__
	learn(p, a, ya);
	learn(p, b, yb);
#else
	double g[R] = {0}, k[R] = {0}, s = p->forgetting, t = p->forgetting, c = 0, e = ya, f = yb;
	for (int j = 0; j < R; j++)
		for (int i = 0; i < R; i++) {
			g[i] += p->P[j][i] * a[j];
			k[i] += p->P[j][i] * b[j];
		}
	for (int i = 0; i < R; i++) {
		s += a[i] * g[i];
		c += b[i] * g[i];
		t += b[i] * k[i];
		e -= a[i] * p->theta[i];
		f -= b[i] * p->theta[i];
	}
	double first = 1 / s, share = c * first, second = 1 / (t - share * c);
	f -= share * e;
	for (int i = 0; i < R; i++) {
		k[i] -= share * g[i];
		p->theta[i] += g[i] * (e * first) + k[i] * (f * second);
	}
	for (int j = 0; j < R; j++)
		for (int i = 0; i < R; i++)
			p->P[j][i] -= g[i] * g[j] * first + k[i] * k[j] * second;
#endif
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

/* The paper's D, of what was last and what is now. */
INLINE void derive(const struct baseline_step *s, double *y, double *last, const double *now, int n)
{
	for (int i = 0; i < n; i++) {
		y[i] = s->decay * y[i] + s->lambda * (now[i] - last[i]);
		last[i] = now[i];
	}
}

/* The paper's F, of what was last; what is now waits for the next sample. */
INLINE void hold(const struct baseline_step *s, double *y, double *last, const double *now, int n)
{
	for (int i = 0; i < n; i++) {
		y[i] = s->decay * y[i] + s->held * last[i];
		last[i] = now[i];
	}
}

/* F of what is linear in between. */
INLINE void low_ramp(const struct baseline_step *s, double *y, double *last, const double *now, int n)
{
	for (int i = 0; i < n; i++) {
		y[i] = s->decay * y[i] + s->first * last[i] + s->last * now[i];
		last[i] = now[i];
	}
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

INLINE void friction_entries(const double *dq, double f[4])
{
	f[0] = dq[0];
	f[1] = dq[1];
	f[2] = sgn(dq[0]);
	f[3] = sgn(dq[1]);
}

static void dynamic_start(struct baseline *p, const double *q, const double *dq, const double *tau)
{
	torque_entries(q, dq, p->inertial_in, p->rest_in);
	friction_entries(dq, p->rest_in + 3);
	if (p->exact)
		memcpy(p->inertial, p->inertial_in, sizeof p->inertial);
	memcpy(p->supply_in, tau, sizeof p->supply_in);
}

/* Both rows from filtered entries. */
INLINE void dynamic_learn(struct baseline *p, const double m[5])
{
	const double *r = p->rest;
	double a[R] = {m[0], m[1], m[2], r[0], r[1], r[3], 0, r[5], 0};
	double b[R] = {0, m[3] + r[2], m[4], 0, r[1], 0, r[4], 0, r[6]};
	learn_both(p, a, b, p->supply[0], p->supply[1]);
	forget(p);
}

INLINE void dynamic_paper(struct baseline *p, const double *q, const double *dq, const double *tau)
{
	double momentum[5], rest[7];
	torque_entries(q, dq, momentum, rest);
	friction_entries(dq, rest + 3);
	derive(&p->whole, p->inertial, p->inertial_in, momentum, 5);
	hold(&p->whole, p->rest, p->rest_in, rest, 7);
	hold(&p->whole, p->supply, p->supply_in, tau, 2);
	dynamic_learn(p, p->inertial);
}

INLINE void dynamic_exact(struct baseline *p, const double *q, const double *dq, const double *before, const double *now)
{
	const struct baseline_step *s = &p->whole;
	double momentum[5], rest[5], derivative[5];
	torque_entries(q, dq, momentum, rest);
	rest[3] = dq[0];
	rest[4] = dq[1];
	low_ramp(s, p->inertial, p->inertial_in, momentum, 5);
	low_ramp(s, p->rest, p->rest_in, rest, 5);
	for (int i = 0; i < 5; i++)
		derivative[i] = s->lambda * (momentum[i] - p->inertial[i]);
	for (int i = 0; i < 2; i++) {
		p->rest[5 + i] = s->decay * p->rest[5 + i] + sign_step(s, s->lambda * p->h, p->last_dq[i], dq[i]);
		p->supply[i] = p->half.decay * p->supply[i] + p->half.held * before[i];
		p->supply[i] = p->half.decay * p->supply[i] + p->half.held * now[i];
	}
	dynamic_learn(p, derivative);
}

/* ---- schemes with one row: energies, then powers of friction ---- */

static void scalar_start(struct baseline *p, const double *q, const double *dq, const double *tau)
{
	energy_entries(q, dq, p->inertial_in);
	power_entries(dq, p->rest_in);
	if (p->exact && p->scheme == BASELINE_POWER)
		memcpy(p->inertial, p->inertial_in, sizeof p->inertial);
	p->supply_in[0] = tau[0] * dq[0] + tau[1] * dq[1];
}

INLINE void scalar_learn(struct baseline *p, const double e[5])
{
	const double *r = p->rest;
	double psi[R] = {e[0], e[1], e[2], e[3], e[4], r[0], r[1], r[2], r[3]};
	learn(p, psi, p->supply[0]);
	forget(p);
}

/* ---- supplied energy model, equation (28) ---- */

INLINE void energy_update(struct baseline *p, int exact, const double *q, const double *dq, const double *tau, const double *before, const double *middle)
{
	double energy[5], half = 0.5 * p->h;
	energy_entries(q, dq, energy);
	if (exact) {
		for (int i = 0; i < 2; i++) {
			double from = p->last_dq[i], to = dq[i], sum = fabs(from) + fabs(to);
			p->rest[i] += p->third * (from * from + from * to + to * to);
			p->rest[2 + i] += half * (turns(from, to) ? (from * from + to * to) / sum : sum);
			p->supply[0] += before[i] * (middle[i] - p->state_q[i]) + tau[i] * (q[i] - middle[i]);
		}
	} else {
		double power[4], supplied = tau[0] * dq[0] + tau[1] * dq[1];
		power_entries(dq, power);
		for (int j = 0; j < 4; j++) {
			p->rest[j] += (p->rest_in[j] + power[j]) * half;
			p->rest_in[j] = power[j];
		}
		p->supply[0] += (p->supply_in[0] + supplied) * half;
		p->supply_in[0] = supplied;
	}
	for (int j = 0; j < 5; j++)
		energy[j] -= p->inertial_in[j];
	scalar_learn(p, energy);
}

/* ---- filtered power model, equation (30) ---- */

INLINE void power_paper(struct baseline *p, const double *q, const double *dq, const double *tau)
{
	double energy[5], power[4], supplied = tau[0] * dq[0] + tau[1] * dq[1];
	energy_entries(q, dq, energy);
	power_entries(dq, power);
	derive(&p->whole, p->inertial, p->inertial_in, energy, 5);
	hold(&p->whole, p->rest, p->rest_in, power, 4);
	hold(&p->whole, p->supply, p->supply_in, &supplied, 1);
	scalar_learn(p, p->inertial);
}

INLINE void power_exact(struct baseline *p, const double *q, const double *dq, const double *before, const double *now)
{
	const struct baseline_step *s = &p->whole;
	double energy[5], middle[5], derivative[5], half_q[2], half_dq[2];
	for (int i = 0; i < 2; i++) {
		half_q[i] = 0.5 * (p->state_q[i] + q[i]) - (dq[i] - p->last_dq[i]) * (0.125 * p->h);
		half_dq[i] = 0.5 * (p->last_dq[i] + dq[i]);
	}
	energy_entries(q, dq, energy);
	energy_entries(half_q, half_dq, middle);
	for (int i = 0; i < 2; i++) {
		p->rest[i] = square(s, p->rest[i], p->last_dq[i], dq[i]);
		p->rest[2 + i] = speed(s, s->lambda * p->h, p->rest[2 + i], p->last_dq[i], dq[i]);
	}
	for (int j = 0; j < 5; j++)
		middle[j] -= 0.5 * (energy[j] + p->inertial_in[j]);
	low_ramp(s, p->inertial, p->inertial_in, energy, 5);
	for (int j = 0; j < 5; j++) {
		p->inertial[j] += s->bulge * middle[j];
		derivative[j] = s->lambda * (energy[j] - p->inertial[j]);
	}
	double from = before[0] * p->last_dq[0] + before[1] * p->last_dq[1];
	double turn = before[0] * half_dq[0] + before[1] * half_dq[1];
	double on = now[0] * half_dq[0] + now[1] * half_dq[1], to = now[0] * dq[0] + now[1] * dq[1];
	low_ramp(&p->half, p->supply, &from, &turn, 1);
	low_ramp(&p->half, p->supply, &on, &to, 1);
	scalar_learn(p, derivative);
}

/* ---- one sample in ---- */

void baseline_start(struct baseline *p, enum baseline_scheme scheme, int exact, double h, double cutoff, double p0, double forgetting)
{
	memset(p, 0, sizeof *p);
	p->scheme = scheme;
	p->exact = exact;
	p->h = h;
	p->inverse = 1 / h;
	p->third = h / 3;
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
	else
		scalar_start(p, q, dq, tau);
}

INLINE void regress(struct baseline *p, enum baseline_scheme scheme, int exact, const double *q, const double *dq, const double *tau, const double *before, const double *middle)
{
	if (scheme == BASELINE_ENERGY)
		energy_update(p, exact, q, dq, tau, before, middle);
	else if (scheme == BASELINE_DYNAMIC && exact)
		dynamic_exact(p, q, dq, before, tau);
	else if (scheme == BASELINE_DYNAMIC)
		dynamic_paper(p, q, dq, tau);
	else if (exact)
		power_exact(p, q, dq, before, tau);
	else
		power_paper(p, q, dq, tau);
}

INLINE void update(struct baseline *p, enum baseline_scheme scheme, int exact, const double q[2], const double tau[2])
{
	double at[2], dq[2] = {0, 0};
	for (int i = 0; i < 2; i++) {
		at[i] = exact ? 0.5 * (p->q[i] + q[i]) : q[i];
		if (p->samples > 0)
			dq[i] = (q[i] - p->q[i]) * p->inverse;
	}
	const double *torque = exact ? p->tau : tau;
	if (p->samples == exact)
		begin(p, at, dq, torque);
	else if (p->samples > exact)
		regress(p, scheme, exact, at, dq, torque, p->tau_before, p->q);
	memcpy(p->state_q, at, sizeof at);
	memcpy(p->last_dq, dq, sizeof dq);
	memcpy(p->tau_before, p->tau, sizeof p->tau);
	memcpy(p->q, q, sizeof p->q);
	memcpy(p->tau, tau, sizeof p->tau);
	p->samples++;
}

void baseline_update(struct baseline *p, const double q[2], const double tau[2])
{
	update(p, p->scheme, p->exact, q, tau);
}

long baseline_size(void)
{
	return sizeof(struct baseline);
}

INLINE void run(struct baseline *p, enum baseline_scheme scheme, int exact, const double *q, const double *tau, long samples)
{
	for (long k = 0; k < samples; k++)
		update(p, scheme, exact, q + 2 * k, tau + 2 * k);
}

void baseline_run(struct baseline *p, const double *q, const double *tau, long samples)
{
	if (p->scheme == BASELINE_DYNAMIC && p->exact)
		run(p, BASELINE_DYNAMIC, 1, q, tau, samples);
	else if (p->scheme == BASELINE_DYNAMIC)
		run(p, BASELINE_DYNAMIC, 0, q, tau, samples);
	else if (p->scheme == BASELINE_ENERGY && p->exact)
		run(p, BASELINE_ENERGY, 1, q, tau, samples);
	else if (p->scheme == BASELINE_ENERGY)
		run(p, BASELINE_ENERGY, 0, q, tau, samples);
	else if (p->exact)
		run(p, BASELINE_POWER, 1, q, tau, samples);
	else
		run(p, BASELINE_POWER, 0, q, tau, samples);
}
