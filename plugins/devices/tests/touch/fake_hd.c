/* A fake of the maker's libHD.so: the calls of HDAPI that a program of one device needs, with the rules of its frames.

   The board of a device is a file of shared memory, FAKE_HD_FOLDER/NAME, laid out as `struct board` (mirrored by
   fake_hd.py), so that it outlives the program. The board has no watchdog: it holds the last force until another one is
   written. That is the worst case; what the real one does is not published. Prototypes and constants: hd.h of
   OpenHaptics 3.x as quoted in public repositories. */

#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <pthread.h>
#include <signal.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <time.h>
#include <unistd.h>

typedef unsigned int HHD;
typedef struct { unsigned int errorCode; int internalErrorCode; HHD hHD; } HDErrorInfo;
typedef unsigned int (*Callback)(void *);

enum { CYCLES = 1 << 17, LOGGED = 1 << 14, DEVICES = 4, TASKS = 8, ERRORS = 32 };
enum { INVALID_ENUM = 0x100, INVALID_VALUE, INVALID_OPERATION, BAD_HANDLE = 0x104, EXCEEDED_MAX_FORCE = 0x201,
       ALREADY_INITIATED = 0x301, COMM_ERROR, COMM_CONFIG_ERROR, ILLEGAL_BEGIN = 0x400, ILLEGAL_END,
       INVALID_LICENSE = 0x600 };
enum { FORCE_OUTPUT = 1, CLAMPING = 2, RAMPING = 4, FORCE_LIMIT = 8, ONE_FRAME = 16 };

struct entry { int64_t at; double force[3]; };
struct board {
    double centre[3], radius, turns_per_s;      /* of the handle's circle in the plane of x and y [mm, Hz] */
    double rotation[9];                         /* columns: axes of the handle in the frame of the device */
    double max_force, continuous_force, stiffness, workspace[6];  /* N, N, N/mm, mm */
    int32_t buttons, calibration, style, unlicensed;
    int32_t unplugged, silent, error, errors_left;                /* the scheduler is `silent`; each frame has `error` */
    int32_t jams, jammed, owner, enabled;       /* `jams`: a program that dies leaves it jammed until it is reset */
    double force[3];                            /* held until the next one */
    int64_t force_at;
    uint64_t frames, updates, cycles, logged;
    int64_t late[CYCLES];                       /* end of the callbacks after the due time of their cycle [ns] */
    struct entry log[LOGGED];                   /* each change of the force */
};

static struct device { struct board *board; int in_frame, framed; double force[3]; int has_force; } devices[DEVICES];
static struct task { Callback callback; void *data; unsigned long handle; unsigned short priority; int sync; } tasks[TASKS];
static HDErrorInfo errors[ERRORS];
static int error_count, current = -1, running;
static unsigned long next_handle = 1, rate = 1000;
static pthread_t scheduler;
static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;   /* of tasks and errors */
static pthread_cond_t done = PTHREAD_COND_INITIALIZER;

static int64_t now_ns(void) {
    struct timespec at;
    clock_gettime(CLOCK_MONOTONIC, &at);
    return at.tv_sec * 1000000000LL + at.tv_nsec;
}

static void fail(unsigned int code, int internal) {
    pthread_mutex_lock(&lock);
    if (error_count < ERRORS) errors[error_count++] = (HDErrorInfo){code, internal, current < 0 ? 0xFFFFFFFF : (HHD)current};
    pthread_mutex_unlock(&lock);
}

static struct device *device(HHD handle) {
    if (handle < DEVICES && devices[handle].board) return &devices[handle];
    fail(BAD_HANDLE, 0);
    return NULL;
}

static struct device *this_device(void) { return device((HHD)current); }

static void put_force(struct board *board, const double *force) {
    if (!memcmp(board->force, force, sizeof board->force)) return;
    memcpy(board->force, force, sizeof board->force);
    board->force_at = now_ns();
    struct entry *entry = &board->log[board->logged % LOGGED];
    entry->at = board->force_at;
    memcpy(entry->force, force, sizeof entry->force);
    board->logged++;
}

HHD hdInitDevice(const char *name) {
    const char *folder = getenv("FAKE_HD_FOLDER");
    char path[4096];
    HHD handle = 0;
    puts("****************************************\nThis is a fake of OPENHAPTICS, for tests only");
    snprintf(path, sizeof path, "%s/%s", folder ? folder : ".", name ? name : "Default Device");
    while (handle < DEVICES && devices[handle].board) handle++;
    int file = handle < DEVICES ? open(path, O_RDWR | O_CLOEXEC) : -1;
    if (file < 0) return fail(COMM_ERROR, -errno), 0xFFFFFFFF;
    struct board *board = mmap(NULL, sizeof *board, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
    close(file);
    if (board == MAP_FAILED) return fail(COMM_ERROR, -errno), 0xFFFFFFFF;
    unsigned int code = 0;
    int gone = board->owner && kill(board->owner, 0) && errno == ESRCH;
    if (gone && board->jams) board->jammed = 1;
    if (board->unlicensed) code = INVALID_LICENSE;
    else if (board->unplugged) code = COMM_ERROR;
    else if (board->jammed) code = COMM_CONFIG_ERROR;
    else if (board->owner && !gone) code = ALREADY_INITIATED;
    if (code) return munmap(board, sizeof *board), fail(code, -28), 0xFFFFFFFF;
    board->owner = getpid();
    board->enabled = ONE_FRAME;
    devices[handle] = (struct device){.board = board};
    current = (int)handle;
    return handle;
}

void hdDisableDevice(HHD handle) {
    struct device *here = device(handle);
    if (!here) return;
    here->board->owner = 0;
    munmap(here->board, sizeof *here->board);
    here->board = NULL;
}

void hdMakeCurrentDevice(HHD handle) { if (device(handle)) current = (int)handle; }
HHD hdGetCurrentDevice(void) { return current < 0 ? 0xFFFFFFFF : (HHD)current; }

void hdBeginFrame(HHD handle) {
    struct device *here = device(handle);
    if (!here) return;
    current = (int)handle;
    if (here->in_frame || (here->framed && here->board->enabled & ONE_FRAME)) { fail(ILLEGAL_BEGIN, 0); return; }
    here->in_frame = here->framed = 1;
    memset(here->force, 0, sizeof here->force);
    here->board->frames++;
    if (here->board->unplugged) fail(COMM_ERROR, -28);
}

void hdEndFrame(HHD handle) {
    struct device *here = device(handle);
    if (!here) return;
    if (!here->in_frame) { fail(ILLEGAL_END, 0); return; }
    here->in_frame = 0;
    struct board *board = here->board;
    double size = sqrt(here->force[0] * here->force[0] + here->force[1] * here->force[1] + here->force[2] * here->force[2]);
    for (int i = 0; i < 3; i++) {
        if (board->enabled & CLAMPING && size > board->max_force) here->force[i] *= board->max_force / size;
        else if (board->enabled & FORCE_LIMIT && size > board->max_force) here->force[i] = 0.0;
        if (!(board->enabled & FORCE_OUTPUT)) here->force[i] = 0.0;
    }
    if (size > board->max_force && board->enabled & FORCE_LIMIT && !(board->enabled & CLAMPING)) fail(EXCEEDED_MAX_FORCE, 0);
    if (board->unplugged) { fail(COMM_ERROR, -28); return; }
    if (board->errors_left) {
        board->errors_left--;
        fail((unsigned int)board->error, -1);
    }
    put_force(board, here->force);
}

HDErrorInfo hdGetError(void) {
    HDErrorInfo error = {0, 0, 0};
    pthread_mutex_lock(&lock);
    if (error_count) error = errors[--error_count];
    pthread_mutex_unlock(&lock);
    return error;
}

const char *hdGetErrorString(unsigned int code) {
    switch (code) {
    case 0: return "HD_SUCCESS";
    case COMM_ERROR: return "HD_COMM_ERROR";
    case COMM_CONFIG_ERROR: return "HD_COMM_CONFIG_ERROR";
    case INVALID_LICENSE: return "HD_INVALID_LICENSE";
    default: return "HD_OTHER_ERROR";
    }
}

static int bit(unsigned int capability) {
    if (capability >= 0x4000 && capability <= 0x4004) return 1 << (capability - 0x4000);
    fail(INVALID_ENUM, 0);
    return 0;
}

void hdEnable(unsigned int capability) { struct device *here = this_device(); if (here) here->board->enabled |= bit(capability); }

void hdDisable(unsigned int capability) {
    static const double none[3];
    struct device *here = this_device();
    if (!here) return;
    here->board->enabled &= ~bit(capability);
    if (!(here->board->enabled & FORCE_OUTPUT) && !here->board->unplugged) put_force(here->board, none);
}

unsigned char hdIsEnabled(unsigned int capability) {
    struct device *here = this_device();
    return here && here->board->enabled & bit(capability) ? 1 : 0;
}

static void position(const struct board *board, double *out) {
    double angle = 2.0 * M_PI * board->turns_per_s * (double)(now_ns() % 1000000000000LL) * 1e-9;
    out[0] = board->centre[0] + board->radius * cos(angle);
    out[1] = board->centre[1] + board->radius * sin(angle);
    out[2] = board->centre[2];
}

void hdGetDoublev(unsigned int name, double *out) {
    struct device *here = this_device();
    if (!here) return;
    const struct board *board = here->board;
    switch (name) {
    case 0x2050: position(board, out); break;
    case 0x2051: out[0] = out[1] = out[2] = 0.0; break;
    case 0x2052:  /* column-major */
        for (int column = 0; column < 3; column++) {
            memcpy(out + 4 * column, board->rotation + 3 * column, 3 * sizeof *out);
            out[4 * column + 3] = 0.0;
        }
        position(board, out + 12);
        out[15] = 1.0;
        break;
    case 0x2100: case 0x2150: out[0] = out[1] = out[2] = 0.0; break;
    case 0x2550: case 0x2551: memcpy(out, board->workspace, sizeof board->workspace); break;
    case 0x2602: *out = board->stiffness; break;
    case 0x2603: *out = board->max_force; break;
    case 0x2604: *out = board->continuous_force; break;
    case 0x2700: memcpy(out, here->force, sizeof here->force); break;
    default: fail(INVALID_ENUM, 0);
    }
}

void hdGetIntegerv(unsigned int name, int *out) {
    struct device *here = this_device();
    if (!here) return;
    switch (name) {
    case 0x2000: *out = here->board->buttons; break;
    case 0x2553: *out = 6; break;
    case 0x2554: *out = 3; break;
    case 0x2555: *out = here->board->style; break;
    default: fail(INVALID_ENUM, 0);
    }
}

const char *hdGetString(unsigned int name) {
    switch (name) {
    case 0x2501: return "Fake Touch";
    case 0x2502: return "0.0";
    case 0x2503: return "Nobody";
    case 0x2504: return "00000";
    default: fail(INVALID_ENUM, 0); return "";
    }
}

void hdSetDoublev(unsigned int name, const double *in) {
    struct device *here = this_device();
    if (!here) return;
    if (name != 0x2700) { fail(INVALID_ENUM, 0); return; }
    if (!here->in_frame) { fail(INVALID_OPERATION, 0); return; }
    if (!isfinite(in[0] + in[1] + in[2])) { fail(INVALID_VALUE, 0); return; }
    memcpy(here->force, in, sizeof here->force);
}

unsigned int hdCheckCalibration(void) {
    struct device *here = this_device();
    return here ? (unsigned int)here->board->calibration : 0x5002;
}

void hdUpdateCalibration(unsigned int style) {
    struct device *here = this_device();
    if (!here) return;
    here->board->updates++;
    if ((int)style & here->board->style) here->board->calibration = 0x5000;
    else fail(INVALID_VALUE, 0);
}

static void run_tasks(void) {
    struct task turn[TASKS];
    pthread_mutex_lock(&lock);
    memcpy(turn, tasks, sizeof turn);
    pthread_mutex_unlock(&lock);
    for (int i = 0; i < TASKS; i++) {
        if (!turn[i].callback || turn[i].callback(turn[i].data)) continue;
        pthread_mutex_lock(&lock);
        if (tasks[i].handle == turn[i].handle) tasks[i] = (struct task){0};
        pthread_cond_broadcast(&done);
        pthread_mutex_unlock(&lock);
    }
}

static int is_silent(void) {
    for (int i = 0; i < DEVICES; i++) if (devices[i].board && devices[i].board->silent) return 1;
    return 0;
}

static void *schedule(void *unused) {
    (void)unused;
    int64_t due = now_ns();
    while (running) {
        int64_t now = now_ns(), period = 1000000000LL / (int64_t)rate;
        due = due + period > now ? due + period : now;
        struct timespec until = {due / 1000000000LL, due % 1000000000LL};
        clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, NULL);
        for (int i = 0; i < DEVICES; i++) devices[i].framed = 0;
        if (is_silent()) continue;
        run_tasks();
        int64_t late = now_ns() - due;
        for (int i = 0; i < DEVICES; i++) if (devices[i].board) {
            devices[i].board->late[devices[i].board->cycles % CYCLES] = late;
            devices[i].board->cycles++;
        }
    }
    return NULL;
}

void hdStartScheduler(void) {
    if (running) return;
    running = 1;
    pthread_create(&scheduler, NULL, schedule, NULL);
}

void hdStopScheduler(void) {
    if (!running) return;
    running = 0;
    pthread_join(scheduler, NULL);
}

void hdSetSchedulerRate(unsigned long hz) { if (hz) rate = hz; else fail(INVALID_VALUE, 0); }

static unsigned long add_task(Callback callback, void *data, unsigned short priority, int sync) {
    unsigned long handle = 0;
    pthread_mutex_lock(&lock);
    for (int i = 0; i < TASKS && !handle; i++)
        if (!tasks[i].callback) tasks[i] = (struct task){callback, data, handle = next_handle++, priority, sync};
    while (sync && running) {
        int there = 0;
        for (int i = 0; i < TASKS; i++) there |= tasks[i].callback && tasks[i].handle == handle;
        if (!there) break;
        pthread_cond_wait(&done, &lock);
    }
    pthread_mutex_unlock(&lock);
    return handle;
}

unsigned long hdScheduleAsynchronous(Callback callback, void *data, unsigned short priority) {
    return add_task(callback, data, priority, 0);
}

void hdScheduleSynchronous(Callback callback, void *data, unsigned short priority) {
    if (running) add_task(callback, data, priority, 1);
    else while (callback(data)) ;
}

void hdUnschedule(unsigned long handle) {
    pthread_mutex_lock(&lock);
    for (int i = 0; i < TASKS; i++) if (tasks[i].handle == handle) tasks[i] = (struct task){0};
    pthread_cond_broadcast(&done);
    pthread_mutex_unlock(&lock);
}
