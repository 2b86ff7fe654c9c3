/* Every promise of armgap.h about bad calls, in both precisions, and what a good run gives. Exit status: the line that fails. */
#include <armgap.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#define EXPECT(condition) do { if (!(condition)) { printf("line %d: %s\n", __LINE__, #condition); return 1; } } while (0)

static int double_precision(void)
{
	armgap_estimator estimator, copy;
	armgap_settings settings;
	armgap_report report;
	double q[2] = {0, 0}, tau[2] = {0, 0}, theta[9], sigma[9], errors[2];
	char bytes[sizeof(armgap_settings) + 8];

	EXPECT(armgap_joints(ARMGAP_TWO_LINK) == 2 && armgap_parameters(ARMGAP_TWO_LINK) == 9 && armgap_joints(77) == 0);
	EXPECT(armgap_settings_default(NULL, ARMGAP_AXIS) == ARMGAP_NULL);
	EXPECT(armgap_settings_default((armgap_settings *)(void *)(bytes + 1 + ((size_t)bytes & 1)), 0) == ARMGAP_UNALIGNED);
	EXPECT(armgap_settings_default(&settings, 3) == ARMGAP_RANGE);
	EXPECT(armgap_settings_default(&settings, ARMGAP_TWO_LINK) == ARMGAP_OK);

	memset(&estimator, 0, sizeof estimator);
	EXPECT(armgap_update(&estimator, 0, q, NULL, tau, 2) == ARMGAP_NOT_STARTED);
	memset(&estimator, 0xa5, sizeof estimator);
	EXPECT(armgap_theta(&estimator, theta, 9) == ARMGAP_NOT_STARTED);
	EXPECT(armgap_start(NULL, sizeof estimator, &settings, NULL, 0) == ARMGAP_NULL);
	EXPECT(armgap_start(&estimator, sizeof estimator, NULL, NULL, 0) == ARMGAP_NULL);
	EXPECT(armgap_start(&estimator, sizeof estimator - 8, &settings, NULL, 0) == ARMGAP_VERSION);
	EXPECT(armgap_start(&estimator, sizeof estimator, &settings, theta, 3) == ARMGAP_LENGTH);
	EXPECT(armgap_start(&estimator, sizeof estimator, &settings, NULL, 9) == ARMGAP_NULL);

	settings.cutoff = NAN;
	EXPECT(armgap_start(&estimator, sizeof estimator, &settings, NULL, 0) == ARMGAP_RANGE);
	settings.cutoff = 50;
	settings.scheme = 3;
	EXPECT(armgap_start(&estimator, sizeof estimator, &settings, NULL, 0) == ARMGAP_RANGE);
	settings.scheme = ARMGAP_FILTERED_DYNAMIC;
	EXPECT(armgap_start(&estimator, sizeof estimator, &settings, NULL, 0) == ARMGAP_OK);

	EXPECT(armgap_update(&estimator, 0, NULL, NULL, tau, 2) == ARMGAP_NULL);
	EXPECT(armgap_update(&estimator, 0, q, NULL, tau, 1) == ARMGAP_LENGTH);
	EXPECT(armgap_update(&estimator, 0, q, NULL, tau, 1000000) == ARMGAP_LENGTH);
	EXPECT(armgap_update(&estimator, 0, q, NULL, tau, 2) == ARMGAP_STARTING);
	EXPECT(armgap_update(&estimator, 0, q, NULL, tau, 2) == ARMGAP_REJECTED);
	EXPECT(armgap_update_after(&estimator, -1, q, NULL, tau, 2) == ARMGAP_REJECTED);
	for (int k = 1; k < 50; k++) {
		q[0] = sin(0.1 * k), q[1] = cos(0.07 * k), tau[0] = k % 5, tau[1] = -(k % 3);
		armgap_status status = k % 2 ? armgap_update(&estimator, 0.0025 * k, q, NULL, tau, 2)
		                             : armgap_update_after(&estimator, 0.0025, q, NULL, tau, 2);
		EXPECT(status == (k < 2 ? ARMGAP_STARTING : ARMGAP_OK));
	}
	q[0] = NAN;
	copy = estimator;
	EXPECT(armgap_update(&estimator, 1, q, NULL, tau, 2) == ARMGAP_REJECTED);
	EXPECT(armgap_theta(&estimator, theta, 8) == ARMGAP_LENGTH);
	EXPECT(armgap_theta(&estimator, NULL, 9) == ARMGAP_NULL);
	EXPECT(armgap_theta(&estimator, theta, 9) == ARMGAP_OK);
	EXPECT(armgap_sigma(&estimator, sigma, 9) == ARMGAP_OK);
	EXPECT(armgap_errors(&estimator, errors, 1) == ARMGAP_LENGTH);
	EXPECT(armgap_errors(&estimator, errors, 2) == ARMGAP_OK);
	EXPECT(armgap_report_of(&estimator, NULL) == ARMGAP_NULL);
	EXPECT(armgap_report_of(&estimator, &report) == ARMGAP_OK);
	EXPECT(report.updates == 48 && report.rejected == 3 && report.parameters == 9 && report.outputs == 2);
	for (int i = 0; i < 9; i++)
		EXPECT(isfinite(theta[i]) && isfinite(sigma[i]) && sigma[i] >= 0);
	/* A copy is an estimator of its own: a checkpoint. */
	EXPECT(armgap_report_of(&copy, &report) == ARMGAP_OK && report.rejected == 2);
	EXPECT(strlen(armgap_message(ARMGAP_NOT_STARTED)) > 10 && strlen(armgap_message(99)) > 3);
	return 0;
}

static int single_precision(void)
{
	armgap_estimator_f32 estimator;
	armgap_settings settings;
	float q[1] = {0}, dq[1] = {0}, tau[1] = {0}, theta[5];
	double motion_q[1] = {0.1}, motion_dq[1] = {0}, torque[1], truth[4] = {0.5, 2.0, 0.2, 0.3};

	EXPECT(armgap_settings_default(&settings, ARMGAP_PENDULUM) == ARMGAP_OK);
	settings.asymmetry = 1;
	EXPECT(armgap_start_f32(&estimator, sizeof estimator, &settings, NULL, 0) == ARMGAP_OK);
	/* The two precisions do not pass for each other. */
	EXPECT(armgap_theta((armgap_estimator *)(void *)&estimator, (double *)(void *)theta, 4) == ARMGAP_NOT_STARTED);
	for (int k = 0; k < 4000; k++) {
		torque[0] = 3 * sin(0.011 * k) + 2 * sin(0.031 * k);
		q[0] = (float)motion_q[0], dq[0] = (float)motion_dq[0], tau[0] = (float)torque[0];
		EXPECT(armgap_update_after_f32(&estimator, 0.0025f, q, dq, tau, 1) >= 0);
		EXPECT(armgap_advance(ARMGAP_PENDULUM, truth, 4, 0.0025, motion_q, motion_dq, torque, 1) == ARMGAP_OK);
	}
	EXPECT(armgap_update_after_f32(&estimator, 0.0025f, q, NULL, tau, 1) == ARMGAP_REJECTED);
	EXPECT(armgap_theta_f32(&estimator, theta, 5) == ARMGAP_OK);
	for (int i = 0; i < 4; i++)
		EXPECT(fabs(theta[i] / truth[i] - 1) < 0.02);
	EXPECT(fabs(theta[4]) < 0.02);
	EXPECT(armgap_advance(ARMGAP_PENDULUM, truth, 4, 0, motion_q, motion_dq, torque, 1) == ARMGAP_RANGE);
	EXPECT(armgap_advance(ARMGAP_PENDULUM, truth, 3, 0.0025, motion_q, motion_dq, torque, 1) == ARMGAP_LENGTH);
	return 0;
}

int main(void)
{
	return double_precision() || single_precision();
}
