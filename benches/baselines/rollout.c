/*
 * The two-link arm of Reyes and Kelly (1997) with exact dry friction in plain C: the yardstick of the rollouts.
 *
 * What a controls engineer would write by hand for this one arm: M, C and g in closed form, the 2x2 system by Cramer's rule, classical
 * Runge-Kutta at one step per period, sine and cosine from the library. Each joint slides one way, the other, or sticks; a step
 * that would turn a joint around ends where its velocity vanishes, one in which a stuck joint breaks away ends where that happens.
 * No checks of the input.
 */
#include <math.h>

struct state {
	double q[2], v[2];
	int way[2]; /* -1, 0 (stuck), 1 */
};

struct arm {
	double theta[9], tau[2];
};

/* Accelerations in these modes, and the torques that hold stuck joints. */
static void motion(const struct arm *arm, const struct state *s, double a[2], double hold[2])
{
	const double *p = arm->theta, *q = s->q, *v = s->v;
	double s1 = sin(q[0]), c1 = cos(q[0]), s2 = sin(q[1]), c2 = cos(q[1]);
	double k = p[1] * c2, w = p[1] * s2, outer = p[4] * (s1 * c2 + c1 * s2);
	double m00 = p[0] + 2 * k, m01 = p[2] + k, m11 = p[2];
	double b0 = arm->tau[0] + w * v[1] * (2 * v[0] + v[1]) - p[3] * s1 - outer - p[5] * v[0] - p[7] * s->way[0];
	double b1 = arm->tau[1] - w * v[0] * v[0] - outer - p[6] * v[1] - p[8] * s->way[1];
	if (s->way[0] && s->way[1]) {
		double det = m00 * m11 - m01 * m01;
		a[0] = (m11 * b0 - m01 * b1) / det;
		a[1] = (m00 * b1 - m01 * b0) / det;
	} else {
		a[0] = s->way[0] ? b0 / m00 : 0;
		a[1] = s->way[1] ? b1 / m11 : 0;
	}
	hold[0] = s->way[0] ? 0 : b0 - m01 * a[1];
	hold[1] = s->way[1] ? 0 : b1 - m01 * a[0];
}

static struct state moved(const struct state *s, double h, const double v[2], const double a[2])
{
	struct state next = *s;
	for (int j = 0; j < 2; j++) {
		next.q[j] = s->q[j] + h * v[j];
		next.v[j] = s->v[j] + h * a[j];
	}
	return next;
}

/* A step of classical Runge-Kutta whose first acceleration is known. */
static struct state step(const struct arm *arm, const struct state *s, double h, const double a1[2])
{
	double a2[2], a3[2], a4[2], hold[2];
	struct state s2 = moved(s, h / 2, s->v, a1);
	motion(arm, &s2, a2, hold);
	struct state s3 = moved(s, h / 2, s2.v, a2);
	motion(arm, &s3, a3, hold);
	struct state s4 = moved(s, h, s3.v, a3);
	motion(arm, &s4, a4, hold);
	struct state next = *s;
	for (int j = 0; j < 2; j++) {
		next.q[j] += h / 6 * (s->v[j] + 2 * (s2.v[j] + s3.v[j]) + s4.v[j]);
		next.v[j] += h / 6 * (a1[j] + 2 * (a2[j] + a3[j]) + a4[j]);
	}
	return next;
}

/* What holding joint j takes beyond its Coulomb torque. */
static double excess(const struct arm *arm, const double hold[2], int j)
{
	return fabs(hold[j]) - arm->theta[7 + j];
}

/* Lets go of joints that friction cannot hold, and holds those let go to no avail; gives the accelerations. */
static void settle(const struct arm *arm, struct state *s, double a[2])
{
	double hold[2];
	int tried[2] = {0, 0};
	motion(arm, s, a, hold);
	for (int i = 0; i < 4; i++) {
		int changed = 0;
		for (int j = 0; j < 2 && !changed; j++) {
			if (s->way[j] == 0 && !tried[j] && excess(arm, hold, j) > 0) {
				s->way[j] = hold[j] > 0 ? 1 : -1;
				changed = 1;
			} else if (s->way[j] && s->v[j] == 0 && a[j] * s->way[j] < 0) {
				s->way[j] = 0;
				tried[j] = changed = 1;
			}
		}
		if (!changed)
			return;
		motion(arm, s, a, hold);
	}
}

/* The event that joint j has within the step: its velocity, or what it lacks, passes zero. */
static double event(const struct arm *arm, const struct state *start, const struct state *end, int j)
{
	double a[2], hold[2];
	if (start->way[j])
		return -end->v[j] * start->way[j];
	motion(arm, end, a, hold);
	return excess(arm, hold, j);
}

/* Part of the step after which joint j has its event, by false position, and the state there. */
static double located(const struct arm *arm, const struct state *s, double h, const double a[2], int j, double after,
		      struct state *there)
{
	double low = 0, high = 1, before = event(arm, s, s, j);
	int last = 0;
	*there = *s;
	if (before >= 0 && s->way[j] == 0)
		return 0;
	for (int i = 0; i < 20; i++) {
		double at = high - after * (high - low) / (after - before), value;
		*there = step(arm, s, at * h, a);
		value = event(arm, s, there, j);
		if (fabs(value) < 1e-10)
			return at;
		if (value > 0) {
			high = at, after = value;
			before *= last > 0 ? 0.5 : 1;
			last = 1;
		} else {
			low = at, before = value;
			after *= last < 0 ? 0.5 : 1;
			last = -1;
		}
	}
	return high;
}

/* One period under a held torque. */
static void period(const struct arm *arm, struct state *s, double h)
{
	for (int i = 0; i < 16 && h > 0; i++) {
		double a[2], first = 2, part;
		int which = -1;
		struct state end, there, best;
		settle(arm, s, a);
		end = step(arm, s, h, a);
		for (int j = 0; j < 2; j++) {
			if (s->way[j] ? end.v[j] * s->way[j] >= 0 : 0)
				continue;
			double after = event(arm, s, &end, j);
			if (after <= 0)
				continue;
			part = located(arm, s, h, a, j, after, &there);
			if (part < first)
				first = part, which = j, best = there;
		}
		if (which < 0) {
			*s = end;
			return;
		}
		if (s->way[which]) {
			*s = best;
			s->v[which] = 0;
			s->way[which] = 0;
		} else {
			double hold[2], unused[2];
			motion(arm, &best, unused, hold);
			*s = best;
			s->way[which] = hold[which] > 0 ? 1 : -1;
		}
		h *= 1 - first;
	}
	if (h > 0) {
		/* A joint at the edge of breaking away: the rest with whatever turns round held. */
		double a[2];
		settle(arm, s, a);
		*s = step(arm, s, h, a);
		for (int j = 0; j < 2; j++)
			if (s->v[j] * s->way[j] < 0)
				s->v[j] = 0, s->way[j] = 0;
	}
}

/* A run from x = (q1, q2, dq1, dq2) under torques held for h each; positions after every period. */
void baseline_rollout(const double theta[9], const double x[4], const double *tau, double h, long periods, double *q)
{
	struct arm arm;
	struct state s = {{x[0], x[1]}, {x[2], x[3]}, {0, 0}};
	for (int i = 0; i < 9; i++)
		arm.theta[i] = theta[i];
	for (int j = 0; j < 2; j++)
		s.way[j] = (s.v[j] > 0) - (s.v[j] < 0);
	for (long k = 0; k < periods; k++) {
		arm.tau[0] = tau[2 * k];
		arm.tau[1] = tau[2 * k + 1];
		period(&arm, &s, h);
		q[2 * k] = s.q[0];
		q[2 * k + 1] = s.q[1];
	}
}

/* The same without dry friction: no modes, no events. */
void baseline_rollout_smooth(const double theta[9], const double x[4], const double *tau, double h, long periods, double *q)
{
	struct arm arm;
	struct state s = {{x[0], x[1]}, {x[2], x[3]}, {1, 1}};
	for (int i = 0; i < 9; i++)
		arm.theta[i] = i < 7 ? theta[i] : 0;
	for (long k = 0; k < periods; k++) {
		double a[2], hold[2];
		arm.tau[0] = tau[2 * k];
		arm.tau[1] = tau[2 * k + 1];
		motion(&arm, &s, a, hold);
		s = step(&arm, &s, h, a);
		q[2 * k] = s.q[0];
		q[2 * k + 1] = s.q[1];
	}
}
