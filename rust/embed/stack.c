/* How much stack the calls of the C interface take, found by painting what lies below: for every arm, model and form, the most. */
#include <armgap.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#define DEPTH (1 << 20)
#define PAINT 0xA5

static armgap_estimator estimator;
static armgap_estimator_f32 single;
static armgap_settings settings;
static int sample;

static __attribute__((noinline)) void paint(void)
{
	volatile unsigned char below[DEPTH];
	for (int i = 0; i < DEPTH; i++)
		below[i] = PAINT;
}

static __attribute__((noinline)) int touched(void)
{
	volatile unsigned char below[DEPTH];
	int i = 0;
	while (i < DEPTH && below[i] == PAINT)
		i++;
	return DEPTH - i;
}

static void nothing(void)
{
}

static void start(void)
{
	armgap_start(&estimator, sizeof estimator, &settings, NULL, 0);
}

static void start_f32(void)
{
	armgap_start_f32(&single, sizeof single, &settings, NULL, 0);
}

static void update(void)
{
	double q[2] = {sin(0.1 * sample), sin(0.17 * sample)}, tau[2] = {sample % 7, -(sample % 5)};
	armgap_update_after(&estimator, 0.0025, q, NULL, tau, armgap_joints(settings.arm));
}

static void update_f32(void)
{
	float q[2] = {sinf(0.1f * sample), sinf(0.17f * sample)}, tau[2] = {sample % 7, -(sample % 5)};
	armgap_update_after_f32(&single, 0.0025f, q, NULL, tau, armgap_joints(settings.arm));
}

/* ---- serial arms: all parameters that there is room for ---- */

static uint64_t memory[1 << 14];
static armgap_chain_settings chain_settings;
static armgap_joint joints[7];
static uint32_t columns[72];

static void chain_start(void)
{
	armgap_chain_start(memory, sizeof memory, &chain_settings, joints, columns, NULL, NULL);
}

static void chain_start_f32(void)
{
	armgap_chain_start_f32(memory, sizeof memory, &chain_settings, joints, columns, NULL, NULL);
}

static void chain_update(void)
{
	double q[7], tau[7];
	for (int j = 0; j < 7; j++)
		q[j] = sin((0.1 + 0.03 * j) * sample), tau[j] = (sample + j) % 7;
	armgap_chain_update_after(memory, 0.0025, q, NULL, tau, chain_settings.joints);
}

static void chain_update_f32(void)
{
	float q[7], tau[7];
	for (int j = 0; j < 7; j++)
		q[j] = sinf((0.1f + 0.03f * j) * sample), tau[j] = (sample + j) % 7;
	armgap_chain_update_after_f32(memory, 0.0025f, q, NULL, tau, chain_settings.joints);
}

/* The most of what was seen so far and what this call takes. */
static int most(int so_far, void (*call)(void))
{
	paint();
	call();
	int now = touched();
	return now > so_far ? now : so_far;
}

static void configure(int k)
{
	armgap_settings_default(&settings, k % 3);
	settings.scheme = k / 3 % 3;
	settings.filters = k / 9 % 2;
	settings.form = 1 + k / 18 % 2;
	settings.asymmetry = k / 36;
	settings.forgetting = 0.999;
}

static void chains(uint32_t n, uint32_t parameters)
{
	int seen[4] = {0}, none = most(0, nothing);
	for (uint32_t j = 0; j < n; j++) {
		armgap_joint joint = {ARMGAP_REVOLUTE, 0, {1, 0, 0, 0, 0, -1, 0, 1, 0}, {0.1, 0, 0.3}, {0, 0, 1}};
		joints[j] = joint;
	}
	for (uint32_t i = 0; i < parameters; i++)
		columns[i] = i + 14 * n - parameters;
	for (int k = 0; k < 12; k++) {
		armgap_chain_settings_default(&chain_settings, n, parameters);
		chain_settings.scheme = k % 3;
		chain_settings.filters = k / 3 % 2;
		chain_settings.form = 1 + k / 6;
		chain_settings.forgetting = 0.999;
		seen[0] = most(seen[0], chain_start);
		for (sample = 0; sample < 20; sample++)
			seen[1] = most(seen[1], chain_update);
		seen[2] = most(seen[2], chain_start_f32);
		for (sample = 0; sample < 20; sample++)
			seen[3] = most(seen[3], chain_update_f32);
	}
	printf("stack, %u joints: start %d bytes, update %d; single precision: start %d, update %d; estimator %zu and %zu bytes\n",
	       (unsigned)n, seen[0] - none, seen[1] - none, seen[2] - none, seen[3] - none, armgap_chain_size(n, parameters),
	       armgap_chain_size_f32(n, parameters));
}

int main(void)
{
	int seen[4] = {0}, none = most(0, nothing);
	for (int k = 0; k < 72; k++) {
		configure(k);
		seen[0] = most(seen[0], start);
		seen[2] = most(seen[2], start_f32);
		for (sample = 0; sample < 40; sample++) {
			seen[1] = most(seen[1], update);
			seen[3] = most(seen[3], update_f32);
		}
	}
	printf("stack: start %d bytes, update %d; single precision: start %d, update %d; estimator %zu and %zu bytes\n", seen[0] - none,
	       seen[1] - none, seen[2] - none, seen[3] - none, sizeof estimator, sizeof single);
	chains(2, 20);
	chains(4, 40);
	chains(7, 72);
	return 0;
}
