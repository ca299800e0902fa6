/* Streams of updates that are lost apart from each other and from the heartbeats: one direction of a session. README.md
 * says what it shows.
 *
 * The sender changes any of its two streams at any step, and sends what the receiver lacks in every step; the channel
 * loses updates as it likes, stream by stream, and passes each heartbeat: of the sender at once, of the receiver a step
 * later, so that the round trip R is one step. At any step the session may be interrupted, and begins anew.
 *
 * PROTOCOL  0: heartbeats and updates of any stream stand for all (commit 03d840ac). 1: the present one
 * LIMIT     silence [steps]
 * CHECK     which property is watched: 1 the sender follows, 2 the receiver follows, 3 a stream that the channel passes
 *           for GOOD steps is followed by both; 0 all
 * MUTANT    a fault put into the present protocol, by number
 */
#ifndef PROTOCOL
#define PROTOCOL 1
#endif
#ifndef MUTANT
#define MUTANT 0
#endif
#ifndef LIMIT
#define LIMIT 2
#endif
#ifndef CHECK
#define CHECK 0
#endif
#define WATCHES(property) (CHECK == 0 || CHECK == property)
#define R 1
#define BOUND (LIMIT + R)
#define CAP (BOUND + 2)
#define GOOD 2

byte lack[2];                        /* by stream: 0, or time since the oldest update left that the receiver lacks, and 1 */
byte unheld[2];                      /* the same as the sender knows it */
byte told[2];                        /* the same in the heartbeat of the receiver that is on its way */
byte proven[2];                      /* time since the receiver knew that it lacked nothing */
bool held[2];                        /* the sender knows that the receiver has held any since the last interruption */
bool fresh;                          /* the heartbeat on its way left in this session */
byte alone[2];                       /* by stream: for how many steps the sender has followed while the receiver lacked it */
byte good;                           /* since how many steps the channel passes everything */

/* Chosen within a step, 0 between steps. */
bool changes[2], arrives[2], cut;
byte s;

#define LACKS (lack[0] != 0 || lack[1] != 0)
#if PROTOCOL == 0
#define SENDER_FOLLOWS true
#else
#if MUTANT == 1                      /* only the first stream is watched */
#define IS_HELD (unheld[0] <= BOUND)
#else
#define IS_HELD (unheld[0] <= BOUND && unheld[1] <= BOUND)
#endif
#if MUTANT == 3                      /* after an interruption the sender follows at once */
#define SENDER_FOLLOWS (IS_HELD)
#else
#define SENDER_FOLLOWS (IS_HELD && held[0] && held[1])
#endif
#endif
#define RECEIVER_FOLLOWS (proven[0] <= LIMIT && proven[1] <= LIMIT)

inline count(what, most) { what = (what < most -> what + 1 : most) }

inline interrupt() {
    for (s : 0 .. 1) {
        lack[s] = 1; unheld[s] = 1; held[s] = 0; proven[s] = CAP; told[s] = 0
    }
    fresh = 0
}

inline acknowledge() {
    for (s : 0 .. 1) {
        if :: lack[s] != 0 -> count(lack[s], CAP) :: else fi;
        if :: unheld[s] != 0 -> count(unheld[s], CAP) :: else fi;
        count(proven[s], CAP);
        if
        :: fresh && told[s] == 0 -> unheld[s] = 0; held[s] = 1
        :: fresh && told[s] != 0 && MUTANT != 2 -> unheld[s] = (told[s] < CAP -> told[s] + 1 : CAP)
        :: else
        fi
    }
}

inline send() {
    for (s : 0 .. 1) {
        if
        :: changes[s] ->
            if :: lack[s] == 0 -> lack[s] = 1 :: else fi;
            if :: unheld[s] == 0 || MUTANT == 2 -> unheld[s] = 1 :: else fi     /* 2: a new update starts the time anew */
        :: else
        fi
    }
    for (s : 0 .. 1) {
        if
        :: lack[s] != 0 && arrives[s] ->
            lack[s] = 0; proven[s] = 0;
#if PROTOCOL == 0 || MUTANT == 4     /* an update of one stream stands for both */
            proven[1 - s] = 0
#endif
        :: else
        fi
    }
    if :: !LACKS || MUTANT == 5 -> proven[0] = 0; proven[1] = 0 :: else fi;  /* 5: heartbeats stand for updates */
    for (s : 0 .. 1) { told[s] = lack[s] }
    fresh = 1
}

inline watch() {
    for (s : 0 .. 1) {
        if :: SENDER_FOLLOWS && lack[s] != 0 -> count(alone[s], CAP) :: lack[s] == 0 -> alone[s] = 0 :: else fi;
        assert(!WATCHES(1) || alone[s] <= BOUND);
        assert(!WATCHES(2) || !RECEIVER_FOLLOWS || lack[s] <= BOUND)
    }
    assert(!WATCHES(3) || good < GOOD || (SENDER_FOLLOWS && RECEIVER_FOLLOWS))
}

active proctype world() {
    d_step { interrupt(); s = 0 }
    do
    :: atomic {
        if :: cut = 0 :: cut = 1 fi;
        if :: changes[0] = 0 :: changes[0] = 1 fi;
        if :: changes[1] = 0 :: changes[1] = 1 fi;
        if :: arrives[0] = 0 :: arrives[0] = 1 fi;
        if :: arrives[1] = 0 :: arrives[1] = 1 fi;
        d_step {
            if :: cut || !arrives[0] || !arrives[1] -> good = 0 :: else -> count(good, GOOD) fi;
            acknowledge();
            if :: cut -> interrupt() :: else fi;
            send();
            watch();
            cut = 0; changes[0] = 0; changes[1] = 0; arrives[0] = 0; arrives[1] = 0; s = 0
        }
    }
    od
}
