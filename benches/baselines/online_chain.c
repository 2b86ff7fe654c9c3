/*
 * Filtered dynamic and filtered power model of Reyes and Kelly (1997) for a serial arm of seven rotary joints in plain C: the yardstick of
 * the benchmarks. What a controls engineer would write by hand for one arm: the number of joints fixed, the period known, the consistent
 * filters of docs/decisions/007-exact-filters.md over the chosen columns only, least squares by equation (21) on the full matrix, one
 * scalar update per row. No checks of the input.
 */
#include "online_chain.h"

#include <math.h>
#include <string.h>

#define N JOINTS

typedef double vec[3];

/* ---- three numbers ---- */

static void cross(const vec a, const vec b, vec c)
{
	double x = a[1] * b[2] - a[2] * b[1], y = a[2] * b[0] - a[0] * b[2], z = a[0] * b[1] - a[1] * b[0];
	c[0] = x, c[1] = y, c[2] = z;
}

static void cross_add(const vec a, const vec b, vec c)
{
	vec x;
	cross(a, b, x);
	for (int i = 0; i < 3; i++)
		c[i] += x[i];
}

static double dot(const vec a, const vec b)
{
	return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void turn(const vec R[3], const vec x, vec y)
{
	for (int i = 0; i < 3; i++)
		y[i] = dot(R[i], x);
}

static void turn_back(const vec R[3], const vec x, vec y)
{
	for (int i = 0; i < 3; i++)
		y[i] = R[0][i] * x[0] + R[1][i] * x[1] + R[2][i] * x[2];
}

/* ---- kinematics: motion vectors at the origin of the base, in its axes ---- */

struct twist {
	vec w, v;
};

struct kinematics {
	double R[N][3][3], p[N][3];
	struct twist joint[N], velocity[N];
};

static void move(const struct chain_baseline *b, const double *q, const double *dq, struct kinematics *k)
{
	double before[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
	vec origin = {0, 0, 0};
	struct twist velocity = {{0, 0, 0}, {0, 0, 0}};
	for (int j = 0; j < N; j++) {
		const struct chain_joint *joint = &b->joints[j];
		const double *a = joint->axis;
		double c = cos(q[j]), s = sin(q[j]), d = 1 - c, frame[3][3];
		double own[3][3] = {{c + d * a[0] * a[0], d * a[0] * a[1] - s * a[2], d * a[0] * a[2] + s * a[1]},
		                    {d * a[0] * a[1] + s * a[2], c + d * a[1] * a[1], d * a[1] * a[2] - s * a[0]},
		                    {d * a[0] * a[2] - s * a[1], d * a[1] * a[2] + s * a[0], c + d * a[2] * a[2]}};
		vec step, axis;
		turn(before, joint->translation, step);
		for (int i = 0; i < 3; i++) {
			k->p[j][i] = origin[i] += step[i];
			for (int l = 0; l < 3; l++) {
				frame[i][l] = 0;
				for (int m = 0; m < 3; m++)
					frame[i][l] += before[i][m] * joint->rotation[m][l];
			}
		}
		turn(frame, a, axis);
		for (int i = 0; i < 3; i++)
			for (int l = 0; l < 3; l++) {
				k->R[j][i][l] = 0;
				for (int m = 0; m < 3; m++)
					k->R[j][i][l] += frame[i][m] * own[m][l];
			}
		memcpy(before, k->R[j], sizeof before);
		memcpy(k->joint[j].w, axis, sizeof axis);
		cross(k->p[j], axis, k->joint[j].v);
		for (int i = 0; i < 3; i++) {
			velocity.w[i] += k->joint[j].w[i] * dq[j];
			velocity.v[i] += k->joint[j].v[i] * dq[j];
		}
		k->velocity[j] = velocity;
	}
}

/* A motion vector at the origin of link l, in its axes. */
static struct twist in_link(const struct kinematics *k, int l, const struct twist *x)
{
	struct twist y;
	vec v;
	memcpy(v, x->v, sizeof v);
	cross_add(x->w, k->p[l], v);
	turn_back(k->R[l], x->w, y.w);
	turn_back(k->R[l], v, y.v);
	return y;
}

/* ---- regressors over a link's mass, first moments, second moments xx, xy, yy, xz, yz, zz ---- */

static void momentum_row(const struct twist *joint, const struct twist *velocity, double row[10])
{
	const double *a = joint->w, *w = velocity->w;
	vec h;
	cross(joint->v, w, h);
	cross_add(velocity->v, a, h);
	row[0] = dot(joint->v, velocity->v);
	row[1] = h[0], row[2] = h[1], row[3] = h[2];
	row[4] = a[0] * w[0];
	row[5] = a[0] * w[1] + a[1] * w[0];
	row[6] = a[1] * w[1];
	row[7] = a[0] * w[2] + a[2] * w[0];
	row[8] = a[1] * w[2] + a[2] * w[1];
	row[9] = a[2] * w[2];
}

static void choose(const struct chain_baseline *b, const double *whole, double *row)
{
	for (int c = 0; c < b->r && b->columns[c] < 11 * N; c++)
		row[c] = whole[b->columns[c]];
}

static void momentum_rows(const struct chain_baseline *b, struct chain_state *s)
{
	struct kinematics k;
	double momentum[N][11 * N] = {{0}}, rest[N][11 * N] = {{0}};
	struct twist rate[N];
	move(b, s->q, s->dq, &k);
	for (int l = 0; l < N; l++) {
		struct twist velocity = in_link(&k, l, &k.velocity[l]);
		vec g;
		turn_back(k.R[l], b->gravity, g);
		cross(k.velocity[l].w, k.joint[l].w, rate[l].w);
		cross(k.velocity[l].w, k.joint[l].v, rate[l].v);
		cross_add(k.velocity[l].v, k.joint[l].w, rate[l].v);
		for (int i = 0; i <= l; i++) {
			struct twist joint = in_link(&k, l, &k.joint[i]), turned = in_link(&k, l, &rate[i]);
			double *row = &rest[i][10 * l];
			vec weight;
			momentum_row(&joint, &velocity, &momentum[i][10 * l]);
			momentum_row(&turned, &velocity, row);
			for (int c = 0; c < 10; c++)
				row[c] = -row[c];
			cross(g, joint.w, weight);
			row[0] -= dot(g, joint.v);
			for (int c = 0; c < 3; c++)
				row[1 + c] -= weight[c];
		}
	}
	for (int j = 0; j < N; j++) {
		momentum[j][10 * N + j] = s->dq[j];
		choose(b, momentum[j], s->momentum[j]);
		choose(b, rest[j], s->rest[j]);
	}
}

/* Energies need no vectors of several links in one frame: velocity and gravity go from link to link, in the axes of each. */
static void energy_row(const struct chain_baseline *b, const double *q, const double *dq, double *row)
{
	double whole[11 * N], along = 0;
	vec w = {0, 0, 0}, v = {0, 0, 0}, g;
	memcpy(g, b->gravity, sizeof g);
	for (int l = 0; l < N; l++) {
		const struct chain_joint *joint = &b->joints[l];
		const struct chain_turn *turn = &b->turns[l];
		double c = cos(q[l]), s = sin(q[l]), R[3][3], *e = &whole[10 * l];
		vec h;
		for (int i = 0; i < 3; i++)
			for (int k = 0; k < 3; k++)
				R[i][k] = turn->fixed[i][k] + c * turn->cosine[i][k] + s * turn->sine[i][k];
		along += dot(g, joint->translation);
		cross_add(w, joint->translation, v);
		turn_back(R, w, h);
		for (int i = 0; i < 3; i++)
			w[i] = h[i] + joint->axis[i] * dq[l];
		turn_back(R, v, h);
		memcpy(v, h, sizeof v);
		turn_back(R, g, h);
		memcpy(g, h, sizeof g);
		cross(v, w, h);
		e[0] = 0.5 * dot(v, v) + b->height[l] - along;
		for (int i = 0; i < 3; i++)
			e[1 + i] = h[i] + b->turned_gravity[l][i] - g[i];
		e[4] = 0.5 * w[0] * w[0];
		e[5] = w[0] * w[1];
		e[6] = 0.5 * w[1] * w[1];
		e[7] = w[0] * w[2];
		e[8] = w[1] * w[2];
		e[9] = 0.5 * w[2] * w[2];
	}
	for (int j = 0; j < N; j++)
		whole[10 * N + j] = 0.5 * dq[j] * dq[j];
	choose(b, whole, row);
}

/* ---- recursive least squares, equations (20) to (22), one row ---- */

static void learn(struct chain_baseline *b, const double *psi, double y)
{
	int r = b->r;
	double g[ROOM] = {0}, s = 1, e = y;
	for (int j = 0; j < r; j++)
		for (int i = 0; i < r; i++)
			g[i] += b->P[j][i] * psi[j];
	for (int i = 0; i < r; i++) {
		s += psi[i] * g[i];
		e -= psi[i] * b->theta[i];
	}
	double scale = 1 / s;
	for (int i = 0; i < r; i++)
		b->theta[i] += g[i] * (e * scale);
	for (int j = 0; j < r; j++)
		for (int i = 0; i < r; i++)
			b->P[j][i] -= g[i] * g[j] * scale;
}

/* ---- friction over an interval in which the joint may turn round, velocity linear ---- */

static double sgn(double x)
{
	return (x > 0) - (x < 0);
}

static int turns(double from, double to)
{
	return (from > 0 && to < 0) || (from < 0 && to > 0);
}

static double sign_step(const struct chain_baseline *b, double from, double to)
{
	if (!turns(from, to))
		return sgn(from + to) * (1 - b->decay);
	return sgn(from) * (2 * exp(-b->lambda * b->h * (to / (to - from))) - 1 - b->decay);
}

static double speed(const struct chain_baseline *b, double y, double from, double to)
{
	if (!turns(from, to))
		return b->decay * y + b->first * fabs(from) + b->last * fabs(to);
	return b->decay * (y - fabs(from)) + fabs(to) - (to - from) / (b->lambda * b->h) * sign_step(b, from, to);
}

/* Writes the friction of joint j, or of all if j is negative, into a row. */
static void put_friction(const struct chain_baseline *b, int j, double *psi)
{
	for (int c = b->r - 1; c >= 0 && b->columns[c] >= 11 * N; c--) {
		int kind = (b->columns[c] - 11 * N) / N, joint = (b->columns[c] - 11 * N) % N;
		if (j < 0 || j == joint)
			psi[c] = kind ? b->coulomb[joint] : b->viscous[joint];
	}
}

static int inertial(const struct chain_baseline *b)
{
	int count = 0;
	while (count < b->r && b->columns[count] < 11 * N)
		count++;
	return count;
}

/* ---- the two models ---- */

static const struct chain_state *before(const struct chain_baseline *b)
{
	return &b->state[(b->samples + 1) % 2];
}

static void dynamic(struct chain_baseline *b, const struct chain_state *now, const double *tau_after)
{
	const struct chain_state *s = before(b);
	int count = inertial(b);
	for (int j = 0; j < N; j++) {
		double psi[ROOM] = {0};
		for (int c = 0; c < count; c++) {
			b->low_momentum[j][c] =
			    b->decay * b->low_momentum[j][c] + b->first * s->momentum[j][c] + b->last * now->momentum[j][c];
			b->low_rest[j][c] = b->decay * b->low_rest[j][c] + b->first * s->rest[j][c] + b->last * now->rest[j][c];
			psi[c] = (now->momentum[j][c] - b->low_momentum[j][c]) * b->lambda + b->low_rest[j][c];
		}
		b->viscous[j] = b->decay * b->viscous[j] + b->first * s->dq[j] + b->last * now->dq[j];
		b->coulomb[j] = b->decay * b->coulomb[j] + sign_step(b, s->dq[j], now->dq[j]);
		b->torque[j] = b->half_decay * b->torque[j] + (1 - b->half_decay) * b->tau_before[j];
		b->torque[j] = b->half_decay * b->torque[j] + (1 - b->half_decay) * tau_after[j];
		put_friction(b, j, psi);
		learn(b, psi, b->torque[j]);
	}
}

static double power_of(const double *tau, const double *dq)
{
	double sum = 0;
	for (int j = 0; j < N; j++)
		sum += tau[j] * dq[j];
	return sum;
}

static void power(struct chain_baseline *b, const struct chain_state *now, const double *tau_after)
{
	const struct chain_state *s = before(b);
	int count = inertial(b);
	double psi[ROOM] = {0}, middle[ROOM], q[N], dq[N];
	for (int j = 0; j < N; j++) {
		q[j] = 0.5 * (s->q[j] + now->q[j]) - (now->dq[j] - s->dq[j]) * b->h / 8;
		dq[j] = 0.5 * (s->dq[j] + now->dq[j]);
	}
	energy_row(b, q, dq, middle);
	for (int c = 0; c < count; c++) {
		double height = middle[c] - 0.5 * (now->energy[c] + s->energy[c]);
		b->low_energy[c] =
		    b->decay * b->low_energy[c] + b->first * s->energy[c] + b->last * now->energy[c] + b->bulge * height;
		psi[c] = (now->energy[c] - b->low_energy[c]) * b->lambda;
	}
	for (int j = 0; j < N; j++) {
		double from = s->dq[j], to = now->dq[j], change = to - from;
		b->viscous[j] =
		    b->decay * b->viscous[j] + b->first * from * from + b->last * to * to - b->bulge * 0.25 * change * change;
		b->coulomb[j] = speed(b, b->coulomb[j], from, to);
	}
	put_friction(b, -1, psi);
	b->supply = b->half_decay * b->supply + b->half_first * power_of(b->tau_before, s->dq) +
	            b->half_last * power_of(b->tau_before, dq);
	b->supply = b->half_decay * b->supply + b->half_first * power_of(tau_after, dq) +
	            b->half_last * power_of(tau_after, now->dq);
	learn(b, psi, b->supply);
}

static void rows(const struct chain_baseline *b, struct chain_state *s)
{
	if (b->power)
		energy_row(b, s->q, s->dq, s->energy);
	else
		momentum_rows(b, s);
}

static void update(struct chain_baseline *b, const double *q, const double *tau)
{
	if (b->samples > 0) {
		struct chain_state *now = &b->state[b->samples % 2];
		for (int j = 0; j < N; j++) {
			now->q[j] = 0.5 * (b->q[j] + q[j]);
			now->dq[j] = (q[j] - b->q[j]) / b->h;
		}
		rows(b, now);
		if (b->samples == 1) {
			memcpy(b->low_momentum, now->momentum, sizeof b->low_momentum);
			memcpy(b->low_energy, now->energy, sizeof b->low_energy);
		} else if (b->power) {
			power(b, now, b->tau);
		} else {
			dynamic(b, now, b->tau);
		}
	}
	memcpy(b->q, q, sizeof b->q);
	memcpy(b->tau_before, b->tau, sizeof b->tau);
	memcpy(b->tau, tau, sizeof b->tau);
	b->samples++;
}

static void coefficients(double x, double *decay, double *first, double *last)
{
	double a = exp(-x), mean = (1 - a) / x;
	*decay = a, *first = mean - a, *last = 1 - mean;
}

void chain_start(struct chain_baseline *b, int power, const double *joints, const double *gravity, const int *columns, int r, double h,
                 double cutoff, double p0)
{
	double x = cutoff * h, zero[N] = {0};
	struct kinematics k;
	memset(b, 0, sizeof *b);
	memcpy(b->joints, joints, sizeof b->joints);
	memcpy(b->gravity, gravity, sizeof b->gravity);
	memcpy(b->columns, columns, r * sizeof *columns);
	b->r = r, b->power = power, b->h = h, b->lambda = cutoff;
	coefficients(x, &b->decay, &b->first, &b->last);
	coefficients(x / 2, &b->half_decay, &b->half_first, &b->half_last);
	b->bulge = 4 / x * (1 - 2 / x + b->decay * (1 + 2 / x));
	for (int i = 0; i < r; i++)
		b->P[i][i] = p0;
	for (int l = 0; l < N; l++) {
		const struct chain_joint *joint = &b->joints[l];
		const double *a = joint->axis;
		vec axis;
		turn(joint->rotation, a, axis);
		for (int i = 0; i < 3; i++) {
			cross(joint->rotation[i], a, b->turns[l].sine[i]);
			for (int c = 0; c < 3; c++) {
				b->turns[l].fixed[i][c] = axis[i] * a[c];
				b->turns[l].cosine[i][c] = joint->rotation[i][c] - axis[i] * a[c];
			}
		}
	}
	move(b, zero, zero, &k);
	for (int l = 0; l < N; l++) {
		b->height[l] = dot(gravity, k.p[l]);
		turn_back(k.R[l], gravity, b->turned_gravity[l]);
	}
}

void chain_run(struct chain_baseline *b, const double *q, const double *tau, long samples)
{
	for (long k = 0; k < samples; k++)
		update(b, q + N * k, tau + N * k);
}

long chain_size(void)
{
	return sizeof(struct chain_baseline);
}
