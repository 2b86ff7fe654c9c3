/* Estimators of serial arms: every promise of armgap.h about bad calls, and the vertical two-link arm of Reyes and Kelly (1997) as a serial
 * arm, moved by its own equations. Exit status: 1, with the line that fails. */
#include <armgap.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#define EXPECT(condition) do { if (!(condition)) { printf("line %d: %s\n", __LINE__, #condition); return 1; } } while (0)
#define COUNT 8

/* Joints about z, x pointing down at rest; gravity along x. */
static const armgap_joint ARM[2] = {
	{ARMGAP_REVOLUTE, 0, {1, 0, 0, 0, 1, 0, 0, 0, 1}, {0, 0, 0}, {0, 0, 1}},
	{ARMGAP_REVOLUTE, 0, {1, 0, 0, 0, 1, 0, 0, 0, 1}, {0.45, 0, 0}, {0, 0, 1}},
};
/* First moments along x and moments of inertia about z of both links, viscous and Coulomb friction. */
static const uint32_t COLUMNS[COUNT] = {1, 9, 11, 19, 22, 23, 24, 25};
static const double THETA[9] = {2.3516, 0.083807, 0.1019, 38.465, 1.827, 2.288, 0.175, 7.6, 1.734};

static uint64_t memory[1 << 14], copy[1 << 14];

static void truth(double theta[COUNT])
{
	theta[0] = THETA[3] / 9.81, theta[1] = THETA[0] - THETA[2], theta[2] = THETA[4] / 9.81, theta[3] = THETA[2];
	memcpy(theta + 4, THETA + 5, 4 * sizeof *theta);
}

static void torque(double t, double tau[2])
{
	tau[0] = (1 - exp(-0.8 * t)) * 29 + 68 * sin(16 * t + 0.1) + 9 * sin(20 * t + 0.15);
	tau[1] = (1 - exp(-1.8 * t)) * 1.2 + 8 * sin(26 * t + 0.08) + 2 * sin(12 * t + 0.34);
}

static int bad_calls(void)
{
	armgap_chain_settings settings, wrong;
	armgap_joint bent[2];
	armgap_report report;
	uint32_t columns[COUNT];
	double q[2] = {0, 0}, tau[2] = {0, 0}, theta[COUNT], known[26] = {0};
	size_t size = armgap_chain_size(2, COUNT);

	EXPECT(size > 0 && size <= sizeof memory && armgap_chain_size(7, 72) <= sizeof memory);
	EXPECT(armgap_chain_size(8, 1) == 0 && armgap_chain_size(1, 73) == 0 && armgap_chain_size(0, 1) == 0);
	EXPECT(armgap_chain_size_f32(2, COUNT) < size && armgap_chain_size_f32(2, 0) == 0);
	EXPECT(armgap_chain_settings_default(NULL, 2, COUNT) == ARMGAP_NULL);
	EXPECT(armgap_chain_settings_default(&settings, 8, COUNT) == ARMGAP_RANGE);
	EXPECT(armgap_chain_settings_default(&settings, 2, COUNT) == ARMGAP_OK);
	EXPECT(settings.version == ARMGAP_CHAIN_VERSION && settings.gravity[2] == -9.81);

	memset(memory, 0xa5, sizeof memory);
	EXPECT(armgap_chain_update(memory, 0, q, NULL, tau, 2) == ARMGAP_NOT_STARTED);
	EXPECT(armgap_chain_theta(memory, theta, COUNT) == ARMGAP_NOT_STARTED);
	EXPECT(armgap_chain_start(NULL, size, &settings, ARM, COLUMNS, NULL, NULL) == ARMGAP_NULL);
	EXPECT(armgap_chain_start((char *)memory + 4, size, &settings, ARM, COLUMNS, NULL, NULL) == ARMGAP_UNALIGNED);
	EXPECT(armgap_chain_start(memory, size - 1, &settings, ARM, COLUMNS, NULL, NULL) == ARMGAP_LENGTH);
	EXPECT(armgap_chain_start(memory, size, NULL, ARM, COLUMNS, NULL, NULL) == ARMGAP_NULL);
	EXPECT(armgap_chain_start(memory, size, &settings, NULL, COLUMNS, NULL, NULL) == ARMGAP_NULL);
	EXPECT(armgap_chain_start(memory, size, &settings, ARM, NULL, NULL, NULL) == ARMGAP_NULL);
	wrong = settings, wrong.version = 1;
	EXPECT(armgap_chain_start(memory, size, &wrong, ARM, COLUMNS, NULL, NULL) == ARMGAP_VERSION);
	wrong = settings, wrong.joints = 0;
	EXPECT(armgap_chain_start(memory, size, &wrong, ARM, COLUMNS, NULL, NULL) == ARMGAP_RANGE);
	wrong = settings, wrong.cutoff = NAN;
	EXPECT(armgap_chain_start(memory, size, &wrong, ARM, COLUMNS, NULL, NULL) == ARMGAP_RANGE);
	wrong = settings, wrong.scheme = 3;
	EXPECT(armgap_chain_start(memory, size, &wrong, ARM, COLUMNS, NULL, NULL) == ARMGAP_RANGE);
	wrong = settings, wrong.gravity[1] = INFINITY;
	EXPECT(armgap_chain_start(memory, size, &wrong, ARM, COLUMNS, NULL, NULL) == ARMGAP_RANGE);
	memcpy(bent, ARM, sizeof bent), bent[1].axis[0] = 1;
	EXPECT(armgap_chain_start(memory, size, &settings, bent, COLUMNS, NULL, NULL) == ARMGAP_RANGE);
	memcpy(bent, ARM, sizeof bent), bent[0].kind = 2;
	EXPECT(armgap_chain_start(memory, size, &settings, bent, COLUMNS, NULL, NULL) == ARMGAP_RANGE);
	memcpy(columns, COLUMNS, sizeof columns), columns[3] = columns[2];
	EXPECT(armgap_chain_start(memory, size, &settings, ARM, columns, NULL, NULL) == ARMGAP_RANGE);
	memcpy(columns, COLUMNS, sizeof columns), columns[COUNT - 1] = 28;
	EXPECT(armgap_chain_start(memory, size, &settings, ARM, columns, NULL, NULL) == ARMGAP_RANGE);
	known[3] = NAN;
	EXPECT(armgap_chain_start(memory, size, &settings, ARM, COLUMNS, known, NULL) == ARMGAP_RANGE);

	EXPECT(armgap_chain_start(memory, size, &settings, ARM, COLUMNS, NULL, NULL) == ARMGAP_OK);
	/* The two precisions do not pass for each other. */
	EXPECT(armgap_chain_theta_f32(memory, (float *)(void *)theta, COUNT) == ARMGAP_NOT_STARTED);
	EXPECT(armgap_chain_update(memory, 0, NULL, NULL, tau, 2) == ARMGAP_NULL);
	EXPECT(armgap_chain_update(memory, 0, q, NULL, tau, 3) == ARMGAP_LENGTH);
	EXPECT(armgap_chain_update(memory, 0, q, NULL, tau, 100000) == ARMGAP_LENGTH);
	EXPECT(armgap_chain_update(memory, 0, q, NULL, tau, 2) == ARMGAP_STARTING);
	EXPECT(armgap_chain_update(memory, 0, q, NULL, tau, 2) == ARMGAP_REJECTED);
	q[0] = NAN;
	EXPECT(armgap_chain_update_after(memory, 0.002, q, NULL, tau, 2) == ARMGAP_REJECTED);
	EXPECT(armgap_chain_theta(memory, theta, COUNT - 1) == ARMGAP_LENGTH);
	EXPECT(armgap_chain_theta(memory, NULL, COUNT) == ARMGAP_NULL);
	EXPECT(armgap_chain_variances(memory, theta, COUNT) == ARMGAP_OK && theta[0] == settings.p0);
	EXPECT(armgap_chain_report_of(memory, NULL) == ARMGAP_NULL);
	EXPECT(armgap_chain_report_of(memory, &report) == ARMGAP_OK);
	EXPECT(report.parameters == COUNT && report.outputs == 1 && report.rejected == 2 && report.updates == 0);
	return 0;
}

/* The estimate after ten seconds of motion; with `single`, in single precision. */
static int identified(uint32_t scheme, int single, double within)
{
	armgap_chain_settings settings;
	armgap_report report;
	double q[2] = {0, 0}, dq[2] = {0, 0}, tau[2], theta[COUNT], sigma[COUNT], errors[2], expected[COUNT];
	float single_theta[COUNT];

	EXPECT(armgap_chain_settings_default(&settings, 2, COUNT) == ARMGAP_OK);
	settings.scheme = scheme, settings.gravity[0] = 9.81, settings.gravity[2] = 0;
	if (single)
		EXPECT(armgap_chain_start_f32(memory, sizeof memory, &settings, ARM, COLUMNS, NULL, NULL) == ARMGAP_OK);
	else
		EXPECT(armgap_chain_start(memory, sizeof memory, &settings, ARM, COLUMNS, NULL, NULL) == ARMGAP_OK);
	for (int k = 0; k < 4000; k++) {
		armgap_status status;
		torque(0.0025 * k, tau);
		if (single) {
			float fq[2] = {(float)q[0], (float)q[1]}, fdq[2] = {(float)dq[0], (float)dq[1]}, ftau[2] = {(float)tau[0], (float)tau[1]};
			status = armgap_chain_update_after_f32(memory, 0.0025f, fq, fdq, ftau, 2);
		} else {
			status = k % 2 ? armgap_chain_update(memory, 0.0025 * (k + 1), q, NULL, tau, 2)
			               : armgap_chain_update_after(memory, 0.0025, q, NULL, tau, 2);
		}
		EXPECT(status == (k < (single ? 1 : 2) ? ARMGAP_STARTING : ARMGAP_OK));
		EXPECT(armgap_advance(ARMGAP_TWO_LINK, THETA, 9, 0.0025, q, dq, tau, 2) == ARMGAP_OK);
	}
	if (single) {
		EXPECT(armgap_chain_theta_f32(memory, single_theta, COUNT) == ARMGAP_OK);
		for (int i = 0; i < COUNT; i++)
			theta[i] = single_theta[i];
	} else {
		EXPECT(armgap_chain_theta(memory, theta, COUNT) == ARMGAP_OK);
		EXPECT(armgap_chain_sigma(memory, sigma, COUNT) == ARMGAP_OK);
		EXPECT(armgap_chain_errors(memory, errors, scheme == ARMGAP_FILTERED_DYNAMIC ? 2 : 1) == ARMGAP_OK);
		EXPECT(armgap_chain_report_of(memory, &report) == ARMGAP_OK && report.updates == 3998);
		/* A copy is an estimator of its own: a checkpoint. */
		memcpy(copy, memory, sizeof copy);
		EXPECT(armgap_chain_update(copy, 20, q, NULL, tau, 2) == ARMGAP_OK);
	}
	truth(expected);
	for (int i = 0; i < COUNT; i++)
		if (!(fabs(theta[i] / expected[i] - 1) < within)) {
			printf("scheme %u, single %d: parameter %d is %g, expected %g\n", (unsigned)scheme, single, i, theta[i], expected[i]);
			return 1;
		}
	return 0;
}

int main(void)
{
	for (uint32_t scheme = 0; scheme < 3; scheme++)
		if (identified(scheme, 0, 0.01))
			return 1;
	return bad_calls() || identified(ARMGAP_FILTERED_DYNAMIC, 1, 0.02) || identified(ARMGAP_FILTERED_POWER, 1, 0.02);
}
