/* Streams of updates that are lost apart from each other and from the heartbeats, and interruptions of either end.
 * README.md says what it shows.
 *
 * Two ends with two streams: both of end 0, or one of each. An end changes any of its streams at any step, and sends
 * what is not acknowledged in every step; the channel loses heartbeats and the updates of each stream as it likes. What
 * end 0 sends arrives at once, what end 1 sends a step later, so that the round trip R is one step. At any step either
 * end may be interrupted, and begins anew.
 *
 * PROTOCOL  0: heartbeats and updates of any stream stand for all (commit 03d840ac). 1: after an interruption an end
 *           follows as soon as the other one holds its updates (commit bacc0b8c). 2: the present one
 * LIMIT     silence [steps]
 * WAYS      in which there are streams: 1 or 2
 * CHECK     which property is watched: 1 the sender of a stream follows, 2 its receiver follows, 3 both follow where all
 *           passes for GOOD steps, 4 an end follows only where the other one knows that its updates arrived; 0 all
 * MUTANT    a fault put into the present protocol, by number
 */
#ifndef PROTOCOL
#define PROTOCOL 2
#endif
#ifndef MUTANT
#define MUTANT 0
#endif
#ifndef LIMIT
#define LIMIT 2
#endif
#ifndef WAYS
#define WAYS 1
#endif
#ifndef CHECK
#define CHECK 0
#endif
#define WATCHES(property) (CHECK == 0 || CHECK == property)
#define R 1
#define BOUND (LIMIT + R)
#define CAP (BOUND + 2)
#define GOOD 3

#define SENDER(s) (WAYS == 2 && s == 1)
#define ALL_OF(e, first, second) ((SENDER(0) != (e) || (first)) && (SENDER(1) != (e) || (second)))

byte lack[2];                        /* by stream: 0, or time since the oldest update left that the receiver lacks, and 1 */
byte unheld[2];                      /* the same as the sender knows it */
byte proven[2];                      /* time since the receiver knew that it lacked nothing */
bool held[2];                        /* since its last interruption the sender has known that the receiver holds any */
bool has[2];                         /* since its last interruption the receiver has held any */
byte alone[2];                       /* for how many steps the sender has followed while the receiver lacked it */

bool echo[2];                        /* by end: it has heard a datagram of the other one that acknowledged all its streams */
bool told[2];                        /* it knows that the other one has */
byte good;                           /* since how many steps the channel passes everything */

byte lack_said[2];                   /* what the datagrams on their way say of their sender */
bool has_said[2], all_said, echo_said;

/* Chosen within a step, 0 between steps. */
bool changes[2], arrives[2], beats[2], cuts[2], hears;
byte s;

#define HAS_ALL(e) ALL_OF(1 - (e), has[0], has[1])
#define HOLDS_ALL(e) ALL_OF(1 - (e), has[0] && lack[0] == 0, has[1] && lack[1] == 0)

#if MUTANT == 1                      /* only the first stream is watched */
#define IS_HELD(s) (s == 1 || unheld[s] <= BOUND)
#else
#define IS_HELD(s) (unheld[s] <= BOUND)
#endif
#if PROTOCOL == 0
#define IS_PROVEN(e) true
#elif MUTANT == 3                    /* after an interruption an end follows at once */
#define IS_PROVEN(e) ALL_OF(e, IS_HELD(0), IS_HELD(1))
#elif PROTOCOL == 1
#define IS_PROVEN(e) ALL_OF(e, IS_HELD(0) && held[0], IS_HELD(1) && held[1])
#else
#define IS_PROVEN(e) (told[e] && ALL_OF(e, IS_HELD(0) && held[0], IS_HELD(1) && held[1]))
#endif
#define FOLLOWS(e) (IS_PROVEN(e) && ALL_OF(1 - (e), proven[0] <= LIMIT, proven[1] <= LIMIT))

inline count(what) { what = (what < CAP -> what + 1 : CAP) }

inline pass() {
    for (s : 0 .. 1) {
        if :: lack[s] != 0 -> count(lack[s]) :: else fi;
        if :: unheld[s] != 0 -> count(unheld[s]) :: else fi;
        count(proven[s])
    }
}

inline interrupt(e) {
    for (s : 0 .. 1) {
        if
        :: SENDER(s) == e -> lack[s] = 1; unheld[s] = 1; held[s] = 0
        :: else -> has[s] = 0; proven[s] = CAP
        fi
    }
    echo[1 - e] = 0;
    if :: MUTANT != 6 -> told[e] = 0 :: else fi              /* 6: what was heard before the interruption counts */
}

inline change(e) {
    for (s : 0 .. 1) {
        if
        :: SENDER(s) == e && changes[s] ->
            if :: lack[s] == 0 -> lack[s] = 1 :: else fi;
            if :: unheld[s] == 0 || MUTANT == 2 -> unheld[s] = 1 :: else fi     /* 2: a new update starts the time anew */
        :: else
        fi
    }
}

inline say(e) {
    for (s : 0 .. 1) { if :: SENDER(s) != e -> lack_said[s] = lack[s]; has_said[s] = has[s] :: else fi }
    all_said = HAS_ALL(e); echo_said = echo[e]
}

/* The end e takes what the other one has sent `age` ago: updates that arrive, and what their sender lacked and held. */
inline take(e, age) {
    hears = beats[1 - e];
    for (s : 0 .. 1) { hears = hears || (SENDER(s) != e && arrives[s] && unheld[s] != 0) }
    for (s : 0 .. 1) {
        if
        :: SENDER(s) != e && arrives[s] && unheld[s] != 0 ->
            lack[s] = 0; alone[s] = 0; has[s] = 1; proven[s] = 0;
            if :: PROTOCOL == 0 || MUTANT == 4 -> proven[1 - s] = 0 :: else fi  /* 4: one stream stands for both */
        :: SENDER(s) == e && hears && !has_said[s] && unheld[s] == 0 -> lack[s] = 1; unheld[s] = 1   /* it has forgotten */
        :: SENDER(s) == e && hears && has_said[s] && lack_said[s] == 0 -> unheld[s] = 0; held[s] = 1
        :: SENDER(s) == e && hears && has_said[s] && lack_said[s] != 0 && MUTANT != 2 ->
            unheld[s] = (lack_said[s] + age < CAP -> lack_said[s] + age : CAP)
        :: else
        fi
    }
    for (s : 0 .. 1) {                                       /* 5: heartbeats stand for updates */
        if :: SENDER(s) != e && hears && (HOLDS_ALL(e) || MUTANT == 5) -> proven[s] = 0 :: else fi
    }
    echo[e] = echo[e] || (hears && all_said);
    told[e] = told[e] || (hears && echo_said)
}

inline watch() {
    for (s : 0 .. 1) {
        if :: FOLLOWS(SENDER(s)) && lack[s] != 0 -> count(alone[s]) :: else fi;
        assert(!WATCHES(1) || alone[s] <= BOUND);
        assert(!WATCHES(2) || !FOLLOWS(1 - SENDER(s)) || lack[s] <= BOUND);
        assert(!WATCHES(4) || !FOLLOWS(s) || echo[1 - s])
    }
    assert(!WATCHES(3) || good < GOOD || (FOLLOWS(0) && FOLLOWS(1)))
}

active proctype world() {
    d_step { interrupt(0); interrupt(1); s = 0 }
    do
    :: atomic {
        for (s : 0 .. 1) {
            if :: changes[s] = 0 :: changes[s] = 1 fi;
            if :: arrives[s] = 0 :: arrives[s] = 1 fi;
            if :: cuts[s] = 0 :: cuts[s] = 1 fi;
            if :: beats[s] = 0 :: beats[s] = 1 fi
        }
        d_step {
            if
            :: arrives[0] && arrives[1] && beats[0] && beats[1] && !cuts[0] && !cuts[1] -> good = (good < GOOD -> good + 1 : GOOD)
            :: else -> good = 0
            fi;
            pass();
            take(0, R);
            if :: cuts[0] -> interrupt(0) :: else fi;
            change(0);
            say(0);
            take(1, 0);
            if :: cuts[1] -> interrupt(1) :: else fi;
            change(1);
            say(1);
            watch();
            for (s : 0 .. 1) { changes[s] = 0; arrives[s] = 0; cuts[s] = 0; beats[s] = 0 }
            hears = 0; s = 0
        }
    }
    od
}
