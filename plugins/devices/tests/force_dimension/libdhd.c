/* A stand-in for libdhd: the calls of the published dhdc.h that the driver makes, on devices that only exist in a file.
 *
 * The file is mapped by every process that loads the library, so a device outlives the process that commands it, as a
 * real one does: a force stands until it is replaced, switched off, or its time limit is over. Names that begin with
 * `fake_` are for the tests. Times are of CLOCK_MONOTONIC [s], units are SI.
 */

#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <signal.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <time.h>
#include <unistd.h>

#define DEVICES 4
#define LOGGED 8192
#define MAX_STATUS 17

enum { NO_ERROR, FAILED, COM, BUSY, NO_DRIVER, NO_DEVICE, NOT_AVAILABLE, TIMEOUT, EXPERT_MODE_DISABLED = 9,
       DEVICE_IN_USE = 20, INVALID = 21 };
enum { POWER, CONNECTED, STARTED, RESET, IDLE, FORCE, BRAKE, TORQUE, WRIST_DETECTED, ERROR, GRAVITY, TIMEGUARD,
       WRIST_INIT, REDUNDANCY, FORCEOFFCAUSE };
enum { OFF_NONE, OFF_BUTTON, OFF_VELOCITY, OFF_WATCHDOG, OFF_SOFTWARE };

typedef struct { double at, force[3]; } Entry;

typedef struct {
    double present, type, serial, wrist, handle[3], swing_m, buttons, turned_rad; /* set by the tests */
    double reset, wrist_init, has_watchdog, fails, not_a_number, hang_s;
    double owner, force_on, off_cause, gravity, watchdog; /* what the calls did */
    double command[7], commanded_at, off_at, sets, enables, first_at;
    Entry log[LOGGED];
} Device;

static Device *devices;
static __thread int last_error;
static bool expert;

static double now(void) {
    struct timespec time;
    clock_gettime(CLOCK_MONOTONIC, &time);
    return (double)time.tv_sec + 1e-9 * (double)time.tv_nsec;
}

int fake_attach(const char *path) {
    int file = open(path, O_RDWR | O_CREAT | O_CLOEXEC, 0600);
    if (file < 0 || ftruncate(file, DEVICES * sizeof(Device)) != 0) return -1;
    void *memory = mmap(NULL, DEVICES * sizeof(Device), PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
    close(file);
    if (memory == MAP_FAILED) return -1;
    devices = memory;
    expert = false;
    return 0;
}

static bool attached(void) {
    const char *path = getenv("FAKE_DHD");
    return devices != NULL || (path != NULL && fake_attach(path) == 0);
}

static int fail(int error) {
    last_error = error;
    return -1;
}

/* What the device's own board does by now. */
static void settle(Device *device) {
    double limit = device->watchdog * 125e-6;
    if (device->force_on != 0.0 && limit > 0.0 && now() - device->commanded_at > limit) {
        device->force_on = 0.0;
        device->off_cause = OFF_WATCHDOG;
        device->off_at = device->commanded_at + limit;
    }
}

/* The open device of this process, or NULL with the error set. */
static Device *of(char ID) {
    if (!attached() || ID < 0 || ID >= DEVICES || devices[(int)ID].owner != getpid()) {
        fail(NO_DEVICE);
        return NULL;
    }
    Device *device = &devices[(int)ID];
    if (device->hang_s > 0.0) usleep((useconds_t)(1e6 * device->hang_s));
    if (device->present == 0.0 || device->fails != 0.0) {
        fail(device->present == 0.0 ? COM : (int)device->fails);
        return NULL;
    }
    settle(device);
    return device;
}

static const struct { const char *name; size_t place; } FIELDS[] = {
#define FIELD(name) {#name, offsetof(Device, name)}
    FIELD(present), FIELD(type), FIELD(serial), FIELD(wrist), FIELD(swing_m), FIELD(buttons), FIELD(turned_rad),
    FIELD(reset), FIELD(wrist_init), FIELD(has_watchdog), FIELD(fails), FIELD(not_a_number), FIELD(hang_s),
    FIELD(owner), FIELD(force_on), FIELD(off_cause), FIELD(gravity), FIELD(watchdog), FIELD(commanded_at),
    FIELD(off_at), FIELD(sets), FIELD(enables),
    {"x", offsetof(Device, handle[0])}, {"y", offsetof(Device, handle[1])}, {"z", offsetof(Device, handle[2])},
    {"gripper", offsetof(Device, command[6])},
};

static double *field(int index, const char *name) {
    for (size_t i = 0; attached() && i < sizeof FIELDS / sizeof *FIELDS; i++)
        if (strcmp(FIELDS[i].name, name) == 0) return (double *)((char *)&devices[index] + FIELDS[i].place);
    abort();
}

void fake_set(int index, const char *name, double value) { *field(index, name) = value; }

double fake_get(int index, const char *name) {
    double *value = field(index, name);
    settle(&devices[index]);
    return *value;
}

/* Force and torque on the hand now. */
void fake_displayed(int index, double wrench[6]) {
    Device *device = &devices[index];
    settle(device);
    for (int i = 0; i < 6; i++) wrench[i] = device->force_on != 0.0 ? device->command[i] : 0.0;
}

/* When command `number` came, and the force that it led to; false once it is overwritten or not there yet. */
bool fake_log(int index, long number, double entry[4]) {
    Device *device = &devices[index];
    long count = (long)device->sets;
    if (number >= count || number < count - LOGGED) return false;
    Entry *logged = &device->log[number % LOGGED];
    entry[0] = logged->at;
    memcpy(entry + 1, logged->force, sizeof logged->force);
    return true;
}

/* --- standard SDK */

int dhdErrorGetLast(void) { return last_error; }

const char *dhdErrorGetStr(int error) {
    switch (error) {
        case NO_ERROR: return "no error";
        case COM: return "communication error";
        case NO_DEVICE: return "no device found";
        case NOT_AVAILABLE: return "not available";
        case TIMEOUT: return "timeout";
        case EXPERT_MODE_DISABLED: return "expert mode disabled";
        case DEVICE_IN_USE: return "device in use";
        default: return "undocumented error";
    }
}

const char *dhdErrorGetLastStr(void) { return dhdErrorGetStr(last_error); }

void dhdGetSDKVersion(int *major, int *minor, int *release, int *revision) {
    *major = 3, *minor = 17, *release = 0, *revision = 0;
}

int dhdGetDeviceCount(void) {
    int count = 0;
    while (attached() && count < DEVICES && devices[count].present != 0.0) count++;
    return count;
}

int dhdOpenID(char index) {
    if (!attached() || index < 0 || index >= dhdGetDeviceCount()) return fail(NO_DEVICE);
    Device *device = &devices[(int)index];
    pid_t owner = (pid_t)device->owner;
    if (owner != 0 && owner != getpid() && (kill(owner, 0) == 0 || errno == EPERM)) return fail(DEVICE_IN_USE);
    device->owner = getpid();
    if (device->first_at == 0.0) device->first_at = now();
    return index;
}

int dhdOpen(void) {
    for (char index = 0; index < dhdGetDeviceCount(); index++)
        if (dhdOpenID(index) >= 0) return index;
    return fail(NO_DEVICE);
}

int dhdStop(char ID) {
    Device *device = of(ID);
    if (device == NULL) return -1;
    device->force_on = 0.0;
    device->off_cause = OFF_SOFTWARE;
    return 0;
}

int dhdClose(char ID) {
    if (!attached() || ID < 0 || ID >= DEVICES || devices[(int)ID].owner != getpid()) return fail(NO_DEVICE);
    devices[(int)ID].owner = 0.0;
    return 0;
}

int dhdGetSerialNumber(unsigned short *number, char ID) {
    Device *device = of(ID);
    if (device == NULL) return -1;
    *number = (unsigned short)device->serial;
    return 0;
}

int dhdGetSystemType(char ID) {
    Device *device = of(ID);
    return device == NULL ? -1 : (int)device->type;
}

const char *dhdGetSystemName(char ID) {
    Device *device = of(ID);
    return device == NULL ? NULL : device->type == 33.0 ? "omega.3" : device->type == 108.0 ? "lambda.7" : "stand-in";
}

bool dhdHasWrist(char ID) {
    Device *device = of(ID);
    return device != NULL && device->wrist != 0.0;
}

int dhdGetStatus(int status[MAX_STATUS], char ID) {
    Device *device = of(ID);
    if (device == NULL) return -1;
    memset(status, 0, MAX_STATUS * sizeof *status);
    status[POWER] = status[CONNECTED] = status[STARTED] = 1;
    status[RESET] = device->reset != 0.0;
    status[FORCE] = device->force_on != 0.0;
    status[BRAKE] = !status[FORCE];
    status[TORQUE] = status[FORCE] && status[WRIST_DETECTED];
    status[WRIST_DETECTED] = device->wrist != 0.0;
    status[WRIST_INIT] = device->wrist_init != 0.0;
    status[GRAVITY] = device->gravity != 0.0;
    status[FORCEOFFCAUSE] = (int)device->off_cause;
    return 0;
}

int dhdEnableForce(unsigned char value, char ID) {
    Device *device = of(ID);
    if (device == NULL) return -1;
    device->commanded_at = now();
    device->force_on = value != 0;
    device->off_cause = value != 0 ? OFF_NONE : OFF_SOFTWARE;
    device->enables += value != 0;
    return 0;
}

int dhdSetGravityCompensation(int value, char ID) {
    Device *device = of(ID);
    if (device == NULL) return -1;
    device->gravity = value != 0;
    return 0;
}

/* The handle is where the tests put it, swings about that, yields to the force, and is turned about y. */
int dhdGetPositionAndOrientationFrame(double *px, double *py, double *pz, double matrix[3][3], char ID) {
    Device *device = of(ID);
    if (device == NULL) return -1;
    double wrench[6], time = now() - device->first_at, angle = device->turned_rad;
    fake_displayed(ID, wrench);
    *px = device->handle[0] + device->swing_m * sin(3.0 * time) + 3e-4 * wrench[0];
    *py = device->handle[1] + 3e-4 * wrench[1];
    *pz = device->handle[2] + 3e-4 * wrench[2];
    if (device->not_a_number > 0.0) {
        device->not_a_number -= 1.0;
        *py = NAN;
    }
    memset(matrix, 0, 9 * sizeof(double));
    matrix[1][1] = 1.0;
    matrix[0][0] = matrix[2][2] = cos(angle);
    matrix[0][2] = sin(angle);
    matrix[2][0] = -sin(angle);
    return 0;
}

unsigned int dhdGetButtonMask(char ID) {
    Device *device = of(ID);
    return device == NULL ? 0 : (unsigned int)device->buttons;
}

int dhdSetForceAndTorqueAndGripperForce(double fx, double fy, double fz, double tx, double ty, double tz, double fg,
                                        char ID) {
    Device *device = of(ID);
    if (device == NULL) return -1;
    double command[7] = {fx, fy, fz, tx, ty, tz, fg};
    for (int i = 0; i < 7; i++)
        if (!isfinite(command[i])) return fail(INVALID);
    memcpy(device->command, command, sizeof command);
    device->commanded_at = now();
    Entry *entry = &device->log[(long)device->sets % LOGGED];
    double wrench[6];
    fake_displayed(ID, wrench);
    entry->at = device->commanded_at;
    memcpy(entry->force, wrench, sizeof entry->force);
    device->sets += 1.0;
    return 0;
}

/* --- expert SDK */

int dhdEnableExpertMode(void) {
    expert = true;
    return 0;
}

int dhdDisableExpertMode(void) {
    expert = false;
    return 0;
}

int dhdSetWatchdog(unsigned char value, char ID) {
    Device *device = of(ID);
    if (device == NULL) return -1;
    if (!expert) return fail(EXPERT_MODE_DISABLED);
    if (device->has_watchdog == 0.0) return fail(NOT_AVAILABLE);
    device->watchdog = value;
    return 0;
}

int dhdGetWatchdog(unsigned char *value, char ID) {
    Device *device = of(ID);
    if (device == NULL) return -1;
    if (!expert) return fail(EXPERT_MODE_DISABLED);
    *value = (unsigned char)device->watchdog;
    return 0;
}
