/* Rows of pads for either kind of pin controller: mainline kernels have #pinctrl-cells = <2>, those of
 * BeagleBoard.org mostly 1. An overlay for the other kind applies without an error and switches wrong pads.
 * Configuration: pull-down, no pull, pull-up; + 0x20 receiver on. */
#if PINCTRL_CELLS == 1
#define PINCTRL_KIND "pinctrl-cells 1" /* what the doctor compares with the tree */
#define PAD(offset, configuration, mode) (offset)((configuration) | (mode))
#elif PINCTRL_CELLS == 2
#define PINCTRL_KIND "pinctrl-cells 2"
#define PAD(offset, configuration, mode) (offset)(configuration)(mode)
#else
#error PINCTRL_CELLS: 1 or 2
#endif

#define OUT_LOW 0x00 /* pulled down while nobody drives it */
#define OUT 0x08
#define OUT_HIGH 0x10
#define IN_LOW 0x20
#define IN_HIGH 0x30
